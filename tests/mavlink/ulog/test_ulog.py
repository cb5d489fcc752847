"""ULog files as PX4's own reader has them: every topic, every field, and whatever is left of one that was cut off."""

from collections.abc import Sequence
from io import BytesIO
from math import isnan, nan, pi
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyulog import ULog

from colibri.common.rotations import quaternion_from_euler
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.mavlink.parameters.store import Parameter, Parameters, ParamType
from colibri.mavlink.telemetry.snapshot import BatteryState, EstimatorState, Setpoint, SolverState, TelemetrySnapshot
from colibri.mavlink.ulog import messages, samples, topics, truth
from colibri.mavlink.ulog.blocks import BLOCK_ROWS, Thinning
from colibri.mavlink.ulog.flight_topics import FLIGHT_TOPICS, TRUTH
from colibri.mavlink.ulog.inputs import INPUT
from colibri.mavlink.ulog.log import RowEncoder, TopicLog, beginning
from colibri.mavlink.ulog.recorder import Recorder
from colibri.mavlink.ulog.samples import VehicleStatus, nav_state, status_message

BEGINNING = beginning("Test", {"AN_INT": 3, "A_FLOAT": 0.5})
NUMBERS = np.random.default_rng(1)


def read(content: bytes) -> ULog:
    log = ULog(BytesIO(BEGINNING + content))
    assert not log.file_corruption
    return log


def data(log: ULog, topic: str) -> dict[str, Any]:
    found: dict[str, Any] = log.get_dataset(topic).data
    return found


def sample(time_us: int) -> dict[str, float]:
    numbers = NUMBERS.uniform(0.0, 1.0, len(samples.COLUMNS))
    return dict(zip(samples.COLUMNS, numbers, strict=True)) | {"time_us": time_us}


class Appended(TopicLog):
    def __init__(self) -> None:
        super().__init__(self._append)
        self.content = b""

    def _append(self, encoded: bytes) -> None:
        self.content += encoded


def encoded(encoder: RowEncoder, *rows: Sequence[float]) -> bytes:
    log = Appended()
    for row in rows:
        log.add(encoder, row)
    log.flush()
    return log.content


def single(*numbers: float) -> list[float]:
    return np.array(numbers, dtype=np.float32).tolist()  # type: ignore[no-any-return]


def fields(found: dict[str, Any], names: str, row: int = 0) -> list[float]:
    return [found[name][row].item() for name in names.split()]


def test_a_file_begins_with_facts_parameters_and_all_formats() -> None:
    log = read(b"")
    assert {"sys_name": "Colibri", "ver_hw": "Test"}.items() <= log.msg_info_dict.items()
    assert log.initial_parameters == {"AN_INT": 3, "A_FLOAT": 0.5}
    formats = {*topics.TOPICS, *topics.PARTS, *(topic.name for topic in FLIGHT_TOPICS), INPUT}
    assert log.message_formats.keys() == formats
    assert log.data_list == []


def test_a_control_sample_is_in_ned_and_frd() -> None:
    rows = [sample(8000 * number) for number in range(BLOCK_ROWS + 2)]
    log = read(encoded(samples.SampleBlocks(), *(list(row.values()) for row in rows)))
    for number in (0, 1, BLOCK_ROWS - 1, BLOCK_ROWS + 1):
        r = rows[number]
        for topic in samples._TOPICS:  # noqa: SLF001
            assert data(log, topic)["timestamp"][number] == r["time_us"]
        position = fields(data(log, topics.POSITION), "x y z vx vy vz", number)
        assert position == single(r["y"], r["x"], -r["z"], r["vy"], r["vx"], -r["vz"])
        assert fields(data(log, topics.RATES), "xyz[0] xyz[1] xyz[2]", number) == single(r["p"], -r["q"], -r["r"])
        assert fields(data(log, topics.MOTORS), "control[0] control[3]", number) == single(r["control1"], r["control4"])
        assert isnan(data(log, topics.MOTORS)["control[4]"][number])
        steered = data(log, topics.TRAJECTORY)
        place = fields(steered, "position[0] position[1] position[2]", number)
        assert place == single(r["y_ref"], r["x_ref"], -r["z_ref"])
        assert fields(steered, "velocity[0] acceleration[1]", number) == single(r["vy_ref"], r["ax_ref"])
        assert fields(steered, "yaw yawspeed", number) == pytest.approx([pi / 2 - r["yaw_ref"], -r["yaw_rate_ref"]])
        same = fields(data(log, topics.POSITION_SETPOINT), "x y z vx yaw acceleration[2]", number)
        assert same[:3] == place
        assert same[5] == single(-r["az_ref"])[0]
        decided = fields(data(log, topics.MPC), "solve_time_us control_step_us cost slack delay_us mass_kg", number)
        named = ("solve_time_us", "control_step_us", "cost", "slack", "delay_us", "mass_kg")
        assert decided == single(*(r[name] for name in named))
        assert fields(data(log, topics.MPC), "path_lag_s iterations", number) == single(
            r["path_lag_s"], r["iterations"]
        )


@given(phi=st.floats(-3.0, 3.0), theta=st.floats(-1.5, 1.5), psi=st.floats(-3.0, 3.0))
def test_attitudes_keep_their_angles(phi: float, theta: float, psi: float) -> None:
    """Roll stays, pitch changes its sign, yaw is counted from north."""
    row = dict.fromkeys(samples.COLUMNS, 0.0) | {"phi_ref": phi, "theta_ref": theta, "psi_ref": psi}
    row |= dict(zip(("qw", "qx", "qy", "qz"), quaternion_from_euler(phi, theta, psi), strict=True))
    log = read(encoded(samples.SampleBlocks(), list(row.values())))
    expected = quaternion_from_euler(phi, -theta, pi / 2 - psi)
    held, wanted = data(log, topics.ATTITUDE), data(log, topics.ATTITUDE_SETPOINT)
    for found in ([held[f"q[{i}]"][0] for i in range(4)], [wanted[f"q_d[{i}]"][0] for i in range(4)]):
        assert abs(np.dot(found, expected)) == pytest.approx(1.0, abs=1e-6)


def test_samples_are_thinned_alike_in_every_log() -> None:
    every_8_ms, late, uneven = Thinning(), Thinning(), Thinning()
    picked = [8 * count for count in range(20) if every_8_ms.is_due(8000 * count)]
    assert picked == [0, 40, 80, 120]
    assert [8 * count for count in range(3, 20) if late.is_due(8000 * count)] == picked[1:]
    assert [30 * count for count in range(6) if uneven.is_due(30_000 * count)] == [0, 60, 90, 120]


def test_the_truth_is_in_ned_and_frd() -> None:
    blocks = truth.TruthBlocks(rad_s_per_speed_unit=2.0 * pi / 60.0, capacity_ah=2.0)
    east = dict.fromkeys(TRUTH.names, 0.0) | {"qw": 0.5**0.5, "qz": 0.5**0.5, "u": 3.0, "w": -1.0, "q": 0.25}
    east |= {"x": 1.0, "y": 2.0, "z": 3.0, "omega2": 5000.0, "voltage_v": 12.0}
    rows = [east | {"t": 4000.0 * number, "charge_ah": 0.001 * number} for number in range(2 * BLOCK_ROWS + 3)]
    log = read(encoded(blocks, *(list(row.values()) for row in rows)))
    position = data(log, topics.POSITION_TRUTH)
    assert position["timestamp"].tolist() == [4000 * number for number in range(len(rows))]
    assert fields(position, "x y z vx vy vz") == pytest.approx([2.0, 1.0, -3.0, 3.0, 0.0, 1.0], abs=1e-6)
    assert fields(data(log, topics.RATES_TRUTH), "xyz[1]") == [-0.25]
    escs = data(log, topics.ESCS)
    assert fields(escs, "esc_count esc_online_flags esc[0].esc_rpm esc[1].esc_rpm", -1) == [4, 15, 0, 5000]
    battery = data(log, topics.BATTERY)
    assert battery["current_a"].tolist() == pytest.approx([-1.0, *[0.001 / 0.004 * 3600.0] * 2])
    assert fields(battery, "voltage_v discharged_mah remaining", 1) == pytest.approx([12.0, 63.0, 0.9685])


def test_extreme_numbers_and_a_missing_battery_are_written() -> None:
    blocks = truth.TruthBlocks(rad_s_per_speed_unit=1.0, capacity_ah=0.0)
    log = read(encoded(blocks, [0.0, *[1e300] * (len(TRUTH.names) - 1)]))
    assert [found.name for found in log.data_list if found.name == topics.BATTERY] == []
    assert data(log, topics.POSITION_TRUTH)["z"].tolist() == [-np.inf]


def test_sensors_and_their_estimate() -> None:
    frame = SensorFrame(0, 0, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (0.0, 0.0, 0.0), 1e5, 20.0)
    state = EstimatorState(831, (0.1, 0.2, 0.3, 0.4, 0.5, 0.6), 0.75, 1.5, 0, 0)
    log = read(encoded(samples.SensingBlocks(), samples.sensing_numbers(7000, frame, state)))
    measured = data(log, topics.SENSORS)
    axes = "accelerometer_m_s2[0] accelerometer_m_s2[1] accelerometer_m_s2[2] gyro_rad[0] gyro_rad[1] gyro_rad[2]"
    assert fields(measured, axes) == [1.0, -2.0, -3.0, 4.0, -5.0, -6.0]
    known = data(log, topics.ESTIMATOR)
    names = "timestamp solution_status_flags pos_horiz_accuracy pos_vert_accuracy"
    assert fields(known, names) == [7000, 831, 0.75, 1.5]
    ratios = fields(known, "vel_test_ratio pos_test_ratio hgt_test_ratio hdg_test_ratio hagl_test_ratio")
    assert ratios == single(0.1, 0.2, 0.3, 0.4, 0.5)


def test_modes_have_px4s_numbers() -> None:
    numbers = [nav_state(main << 16 | sub << 24) for main, sub in ((3, 0), (4, 3), (4, 4), (6, 0), (9, 9))]
    assert numbers == [2, 4, 3, 14, 31]
    status = VehicleStatus(
        armed=True, custom_mode=4 << 16 | 5 << 24, failsafe=True, armable=False, armed_us=5, takeoff_us=6
    )
    found = data(read(status_message(9, status, system_id=7)), topics.STATUS)
    names = "timestamp armed_time takeoff_time arming_state nav_state system_id failsafe pre_flight_checks_pass"
    assert fields(found, names) == [9, 5, 6, 2, 5, 7, 1, 0]


def snapshot(time_us: int, **changes: Any) -> TelemetrySnapshot:
    seen: dict[str, Any] = {"armed": True, "controls": (0.1, 0.2, 0.3, 0.4), "position_enu_m": (1.0, 2.0, 3.0)}
    battery = BatteryState(3, 11.5, 2.0, 0.5, 0.75, 600.0, 5.0, charge_state=2)
    return TelemetrySnapshot(time_us=time_us, battery=battery, **(seen | changes))


def test_a_vehicle_of_ground_stations_is_recorded() -> None:
    parameters = Parameters([Parameter(name="A", kind=ParamType.REAL, default=1.0, description="")])
    recorded = Appended()
    recorder = Recorder(recorded, "Test", 1, parameters, with_battery=True)
    recorded.append(recorder.begin())
    for number in range(300):
        solver = SolverState(status=0, iterations=7, step_time_s=1e-4, active=(1, 2, 3, 4))
        recorder.update(snapshot(8000 * number, failsafe=number >= 200, solver=solver, setpoint=Setpoint()))
        if number == 99:
            assert parameters.set("A", 2.0) is None
            recorder.say(8000 * number, 4, "low battery")
    recorded.flush()
    log = ULog(BytesIO(recorded.content))
    assert not log.file_corruption
    assert (log.initial_parameters, [change[1:] for change in log.changed_parameters]) == ({"A": 1.0}, [("A", 2.0)])
    assert [(said.timestamp, said.log_level_str(), said.message) for said in log.logged_messages] == [
        (792_000, "WARNING", "low battery")
    ]
    assert data(log, topics.STATUS)["timestamp"].tolist() == [0, 1_000_000, 1_600_000]
    battery = fields(data(log, topics.BATTERY), "voltage_v current_a discharged_mah remaining warning")
    assert battery == [11.5, 2, 500, 0.75, 1]
    assert len(data(log, topics.POSITION)["x"]) == 60
    assert fields(data(log, topics.MPC), "iterations active_rates qp_status fallback", 59) == [7, 4, 0, -1]


def whole_messages(content: bytes) -> int:
    at = whole = 0
    while at + 3 <= len(content):
        at += 3 + int.from_bytes(content[at : at + 2], "little")
        whole += at <= len(content)
    return whole


def test_a_truncated_file_has_all_messages_before_the_cut() -> None:
    two = (list(sample(8000 * number).values()) for number in range(2))
    content = encoded(samples.SampleBlocks(), *two) + messages.logged_string(5, 6, "end")
    for end in range(len(content) + 1):
        log = ULog(BytesIO(BEGINNING + content[:end]))
        rows = sum(len(found.data["timestamp"]) for found in log.data_list)
        assert rows + len(log.logged_messages) + (end >= len(messages.SYNC)) == whole_messages(content[:end])
    for end in range(16, len(BEGINNING), 97):
        assert ULog(BytesIO(BEGINNING[:end])).data_list == []


def test_a_reader_resynchronises_at_the_next_block() -> None:
    rows = (list(sample(8000 * number).values()) for number in range(3 * BLOCK_ROWS))
    content = encoded(samples.SampleBlocks(), *rows)
    block = len(content) // 3
    log = ULog(BytesIO(BEGINNING + content[: block - 20] + content[block:]))
    assert log.file_corruption
    assert data(log, topics.MPC)["timestamp"][-1] == 8000 * (3 * BLOCK_ROWS - 1)


def test_what_is_no_number_stays_none() -> None:
    row = dict.fromkeys(samples.COLUMNS, nan) | {"time_us": 8000}
    row |= dict.fromkeys(("qp_status", "fallback"), -1)
    row |= dict.fromkeys(("active_rotors", "active_increments", "active_angles", "active_rates"), 0)
    found = data(read(encoded(samples.SampleBlocks(), list(row.values()))), topics.TRAJECTORY)
    assert all(isnan(found[name][0]) for name in ("position[0]", "yaw", "yawspeed"))
