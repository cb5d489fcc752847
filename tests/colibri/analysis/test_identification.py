"""A vehicle's numbers from logs of Colibri, PX4 and ArduPilot, starting with those of another vehicle."""

import tomllib
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import colibri
from colibri.analysis.identification import Identified, identify
from colibri.analysis.recorded_motion import LogError, Motion, Series, read_motion
from colibri.analysis.refinement import refined
from colibri.common.config import read_settings, value_at
from colibri.common.types import Array
from colibri.mavlink.dataflash.recorder import DataFlashRecorder
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.ulog.log import beginning
from colibri.mavlink.ulog.samples import COLUMNS, SENSING_COLUMNS, SampleBlocks, SensingBlocks
from colibri.plant.vehicle.data_sheets import DataSheet, propeller_of, vehicle_file
from colibri.plant.vehicle.description import Vehicle, VehicleError, load_vehicle

LAG = ("rotors.lag.time_constant_up_s", "rotors.lag.time_constant_down_s")
INERTIA = ("body.inertia_kg_m2.0", "body.inertia_kg_m2.1", "body.inertia_kg_m2.2")
THRUST = "rotors.thrust_coefficient"
SHEET = DataSheet("mine", 0.698, 0.171, propeller_of("9x4.7"), "+", "clockwise", kv_rpm_v=920.0, cells=4)


@pytest.fixture(scope="module")
def log_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    @cache
    def flown(vehicle: str) -> Path:
        folder: Path = tmp_path_factory.mktemp(vehicle)
        options: Any = {"vehicle": vehicle, "feedback": "sensors", "wind": "3@270", "turbulence": "light"}
        if vehicle == "firefly":
            options["controller"] = "geometric-se3"  # the law with less machine code
        colibri.fly("lemniscate:lap=5", duration=15.0, **options).save(folder)
        return folder / "flight.ulg"

    return flown


def another(name: str) -> Vehicle:
    """Return a vehicle with the geometry and the mass of a named one, and other numbers."""
    vehicle = load_vehicle(name)
    factors = {THRUST: 1.4, "rotors.torque_coefficient": 0.6, "rotors.max_speed": 1.2, "rotors.idle_speed": 1.2}
    factors |= {"rotors.lag.time_constant_up_s": 4.0, "rotors.lag.time_constant_down_s": 2.0}
    for key, factor in factors.items():
        vehicle = vehicle.replace(key, factor * value_at(vehicle, key, VehicleError))
    return vehicle.replace("body.inertia_kg_m2", [1.5 * moment for moment in vehicle.body.inertia_kg_m2])


def errors(found: Identified, true: str, top: float = 1.0) -> dict[str, float]:
    """Return the relative errors of fitted numbers, with thrust at a part `top` of the true top speed."""
    after = {number.key: number.after for number in found.numbers if number.is_fitted}
    after[THRUST] *= top**2
    return {key: value / value_at(load_vehicle(true), key, VehicleError) - 1.0 for key, value in after.items()}


def written(path: Path, name: str, motion: Motion, hz: float) -> Path:
    """Write a motion as PX4 or ArduPilot would, without rotor speeds."""
    t_s = np.arange(motion.rate.t_s[1], motion.rate.t_s[-2], 1.0 / hz)
    controls = motion.command.at(t_s)[:, load_vehicle(name).rotors.px4_numbering().rotors]
    turn, force = motion.attitude(t_s), motion.force.at(t_s)
    moving = (motion.velocity.at(t_s), turn.as_quat(scalar_first=True), motion.rate.at(t_s), controls)
    if path.suffix == ".bin":
        parts: Iterable[bytes] = _dataflash(np.rint(1e6 * t_s), *moving, turn.apply(force) - [0.0, 0.0, 9.81])
    else:
        parts = _ulog(np.hstack([1e6 * t_s[:, None], np.zeros((len(t_s), 3)), *moving]), force)
    path.write_bytes(b"".join(parts))
    return path


def _dataflash(*columns: Array) -> list[bytes]:
    parts: list[bytes] = []
    recorder = DataFlashRecorder(parts.append, Parameters([]), "ArduCopter V4.7.0")
    parts.append(recorder.begin())
    names = ("velocity_enu_m_s", "attitude", "rate_flu_rad_s", "controls", "acceleration_enu_m_s2")
    for time_us, *vectors in zip(*(column.tolist() for column in columns), strict=True):
        state: Any = dict(zip(names, map(tuple, vectors), strict=True))
        recorder.update(TelemetrySnapshot(int(time_us), armed=True, **state))
    return parts


def _ulog(rows: Array, force: Array) -> Iterator[bytes]:
    yield beginning("Test", {})
    samples, sensing, parts = SampleBlocks(8), SensingBlocks(), len(rows) // 9
    for block, sensed in zip(np.array_split(rows, parts), np.array_split(force, parts), strict=True):
        rest, missing = np.zeros((len(block), len(COLUMNS) - 18)), np.full((len(block), 22 - rows.shape[1]), np.nan)
        yield samples.encode(np.hstack([block[:, :18], rest, block[:, 18:], missing]))
        yield sensing.encode(np.hstack([block[:, :1], sensed, np.zeros((len(block), len(SENSING_COLUMNS) - 4))]))


@pytest.mark.parametrize("name", ["hummingbird", pytest.param("firefly", marks=pytest.mark.long)])
def test_numbers_become_those_of_the_vehicle_in_the_log(log_of: Callable[[str], Path], name: str) -> None:
    found = identify(read_motion(log_of(name)), another(name))
    off = errors(found, name)
    assert {*LAG, *INERTIA, THRUST, "rotors.max_speed", "rotors.torque_coefficient"} <= set(off)
    assert all(abs(part) < 0.02 for key, part in off.items() if "drag" not in key)
    assert all(error < 0.1 * size for quantity, _, size, error in found.held_out if quantity != "drag")  # gusts


@pytest.mark.long
def test_a_log_of_px4_without_rotor_speeds_tells_the_same(log_of: Callable[[str], Path], tmp_path: Path) -> None:
    log = written(tmp_path / "px4.ulg", "firefly", read_motion(log_of("firefly")), 250.0)
    found = identify(read_motion(log), another("firefly"))
    off = errors(found, "firefly", top=1.2)
    assert all(abs(off[key]) < 0.1 for key in (*LAG, *INERTIA, THRUST))
    assert found.curve == pytest.approx(1.0, abs=0.05)


def test_a_log_of_ardupilot_is_too_slow_for_the_lag(log_of: Callable[[str], Path], tmp_path: Path) -> None:
    log = written(tmp_path / "1.bin", "hummingbird", read_motion(log_of("hummingbird")), 25.0)
    found = identify(read_motion(log), another("hummingbird"))
    off = errors(found, "hummingbird", top=1.2)
    assert not set(LAG) & set(off), "the lag of 0.0125 s is kept: commands are 0.04 s apart"
    relative = {number.key: number.relative for number in found.numbers}
    assert all(abs(off[key]) < max(0.05, relative[key]) for key in (THRUST, *INERTIA))


def test_a_refined_file_has_the_fitted_numbers_and_their_sources(log_of: Callable[[str], Path]) -> None:
    text, lines = refined(vehicle_file(SHEET)[0], log_of("hummingbird").parent)
    vehicle, true = read_settings(tomllib.loads(text), Vehicle), load_vehicle("hummingbird")
    assert vehicle.body.inertia_kg_m2 == pytest.approx(true.body.inertia_kg_m2, rel=0.01)
    assert text.count("# fitted to flight.ulg: ±") == 9
    assert lines[-1].startswith("thrust curve (THR_MDL_FAC) 1.00")


def test_another_layout_rest_and_a_short_flight_are_refused(log_of: Callable[[str], Path]) -> None:
    motion, vehicle = read_motion(log_of("hummingbird")), load_vehicle("hummingbird")
    (t_s, command), velocity = motion.command, motion.velocity
    with pytest.raises(LogError, match="look at --layout and --order"):
        identify(motion, load_vehicle("x500").replace("body.mass_kg", 0.698))
    with pytest.raises(LogError, match="commands of 4 rotors, the vehicle 6"):
        identify(motion, load_vehicle("firefly"))
    with pytest.raises(LogError, match="does not move"):
        identify(motion._replace(velocity=Series(velocity.t_s, 0.0 * velocity.values)), vehicle)
    with pytest.raises(LogError, match="10 s are required"):
        identify(motion._replace(command=Series(t_s[t_s < 8.0], command[t_s < 8.0])), vehicle)


@pytest.mark.parametrize("content", [b"", b"no log\n", b"\xa3\x95\x80no", b"ULog\x01\x12\x35\x01" + bytes(8)])
@pytest.mark.parametrize("end", ["ulg", "bin"])
def test_what_is_no_log_is_refused_with_one_line(tmp_path: Path, content: bytes, end: str) -> None:
    path = tmp_path / f"flight.{end}"
    path.write_bytes(content)
    with pytest.raises(colibri.Error, match=r"^[^\n]+(is not a|is missing: log attitude)[^\n]+$"):
        refined(vehicle_file(SHEET)[0], path)
