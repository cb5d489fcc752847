"""Parameters of PX4 and ArduPilot, by what these do with them: the vehicle does what their mixers want of it."""

from math import sqrt
from pathlib import Path

import msgspec
import numpy as np
import pytest
from pymavlink.mavparm import MAVParmDict

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, enu_of
from colibri.common.types import Array, PerRotor, Vector
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.parameters.file import read
from colibri.mavlink.parameters.store import Parameter, Parameters, ParamType
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, starting_world, state_frame
from colibri.plant.sensors.suite import SensorSuite
from colibri.plant.vehicle.description import Vehicle, VehicleError, load_vehicle
from colibri.plant.vehicle.parameter_files import (
    FILES,
    PX4_DELAYS,
    ardupilot_file,
    ardupilot_parameters,
    px4_file,
    px4_parameters,
)

NAMES = ("hummingbird", "hummingbird-thesis", "hummingbird-rangefinder", "iris", "jmavsim")
FRAME_US = 4000
_EXACT = ("horizontal_noise_m", "vertical_noise_m", "horizontal_drift_m", "vertical_drift_m", "velocity_noise_m_s")


def wrench(vehicle: Vehicle, controls: PerRotor) -> Array:
    """Return U1 (N), U2, U3, U4 (N m, FLU) at the controls of another autopilot's motors, in its order."""
    rotors = vehicle.rotors
    speeds = np.array(rotors.speeds_of(rotors.numbering().to_vehicle(controls))) * rotors.max_speed
    made: Array = vehicle.allocation() @ speeds**2
    return made


def curve(expo: float, thrust: float) -> float:
    """Return x, where thrust = (1 - expo) x + expo x²: as both autopilots turn a thrust into a control."""
    return thrust if expo == 0.0 else (expo - 1.0 + sqrt((1.0 - expo) ** 2 + 4.0 * expo * thrust)) / (2.0 * expo)


def px4_motors(values: dict[str, int | float], thrust: float, torque_frd_nm: Array, max_n: float) -> PerRotor:
    """Return the controls by which PX4 answers a collective thrust (0 to 1) and a torque, by its parameters alone.

    The torque of a motor at p is p x F - KM F along its axis (0, 0, -1): KM above 0 turns counter-clockwise.
    """
    motors = range(int(values["CA_ROTOR_COUNT"]))
    x, y, km = (np.array([values[f"CA_ROTOR{i}_{key}"] for i in motors]) for key in ("PX", "PY", "KM"))
    effect = np.array([-y, x, km, np.ones(len(motors))])
    thrusts = np.linalg.solve(effect, [*(torque_frd_nm / max_n), len(motors) * thrust])
    a, b, c, d = (curve(values["THR_MDL_FAC"], each) for each in thrusts.tolist())
    return (a, b, c, d)


@pytest.mark.parametrize("name", NAMES)
def test_px4s_mixer_hovers_and_turns_about_one_axis_at_a_time(name: str) -> None:
    vehicle = load_vehicle(name)
    values, weight_n = px4_parameters(vehicle), vehicle.body.mass_kg * vehicle.gravity_m_s2
    max_n = vehicle.rotors.thrust_coefficient * vehicle.rotors.max_speed**2
    for axis in range(3):
        torque = np.zeros(3)
        torque[axis] = 0.002
        made = wrench(vehicle, px4_motors(values, values["MPC_THR_HOVER"], torque, max_n))
        assert made == pytest.approx([weight_n, torque[0], -torque[1], -torque[2]], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_ardupilots_throttle_is_thrust(name: str) -> None:
    vehicle = load_vehicle(name)
    values, rotors = ardupilot_parameters(vehicle), vehicle.rotors

    def thrust_n(throttle: float) -> float:
        least, most = values["MOT_SPIN_MIN"], values["MOT_SPIN_MAX"]
        control = least + (most - least) * curve(values["MOT_THST_EXPO"], throttle)
        return float(wrench(vehicle, (control,) * 4)[0])

    ends = thrust_n(0.0), thrust_n(1.0)
    assert ends[1] == pytest.approx(vehicle.max_wrench()[0])
    for throttle in np.linspace(0.0, 1.0, 11).tolist():
        assert thrust_n(throttle) == pytest.approx(ends[0] + (ends[1] - ends[0]) * throttle)
    assert thrust_n(values["MOT_THST_HOVER"]) == pytest.approx(vehicle.body.mass_kg * vehicle.gravity_m_s2)
    assert rotors.speeds_of((values["MOT_SPIN_MIN"],) * 4)[0] * rotors.max_speed >= rotors.idle_speed
    assert (values["FRAME_CLASS"], values["FRAME_TYPE"]) == rotors.numbering().ardupilot_frame
    assert (values["MOT_PWM_MIN"], values["MOT_PWM_MAX"]) == (1000, 2000)


@pytest.mark.parametrize("name", ["hummingbird", "hummingbird-rtk", "jmavsim"])
def test_a_fix_is_as_old_as_px4_and_ardupilot_are_told(name: str) -> None:
    """Who takes the delay off the time at which a fix comes has where the vehicle was then, without noise."""
    vehicle = load_vehicle(name)
    for key in _EXACT:
        vehicle = vehicle.replace(f"sensors.gps.{key}", 0.0)
    assert vehicle.sensors is not None
    physics, world = Physics(vehicle, "rk4"), starting_world(Start(z=50.0, vx=6.0, vy=-3.0), vehicle)
    suite = SensorSuite(vehicle.sensors, physics, DEFAULT_ORIGIN, seed=1, interval_us=FRAME_US)
    delays_ms = {px4_parameters(vehicle)[key] for key in PX4_DELAYS}
    delays_ms |= {ardupilot_parameters(vehicle)[key] for key in ("GPS1_DELAY_MS", "SIM_GPS1_LAG_MS")}
    (delay_ms,) = delays_ms
    truth, fixes = {}, 0
    for _ in range(250):
        truth[world.time_us] = state_frame(world)
        fix = suite.measure(world).gps
        if fix is not None:
            then = truth[world.time_us - round(delay_ms * 1e3)]
            assert fix.velocity_enu_m_s == pytest.approx(then.velocity_enu_m_s, abs=1e-9)
            assert enu_of(fix.place, DEFAULT_ORIGIN) == pytest.approx(then.position_enu_m, abs=1e-4)
            fixes += 1
        world = physics.step(world, ActuatorCommand(world.time_us, (0.5, 0.6, 0.6, 0.5), armed=True), FRAME_US)
    assert fixes > 3


def test_px4_parameters_warn_of_delay_and_rangefinder() -> None:
    vehicle = load_vehicle("hummingbird-rangefinder")
    assert px4_parameters(vehicle)["EKF2_RNG_DELAY"] == 0.0
    assert "EKF2_DELAY_MAX" not in px4_parameters(vehicle)
    assert px4_parameters(vehicle.replace("sensors.gps.delay_s", 0.25))["EKF2_DELAY_MAX"] == 250.0
    assert "EKF2_RNG_DELAY" not in px4_parameters(load_vehicle("hummingbird"))
    assert ardupilot_parameters(vehicle.replace("sensors.gps.delay_s", 0.0))["GPS1_DELAY_MS"] == 1  # 0: the driver's


@pytest.mark.parametrize("name", NAMES)
def test_the_file_for_px4_is_one_of_qgroundcontrol(name: str) -> None:
    vehicle = load_vehicle(name)
    wanted = px4_parameters(vehicle)
    kinds = {key: ParamType.INT if isinstance(value, int) else ParamType.REAL for key, value in wanted.items()}
    defined = [Parameter(name=key, kind=kind, default=0, description=key) for key, kind in kinds.items()]
    found = read(px4_file(vehicle, "by a test"), Parameters(defined))
    assert list(found) == list(wanted)
    assert list(found.values()) == pytest.approx(list(wanted.values()), rel=1e-6, abs=1.01e-6)


def test_px4_parameters_leave_out_defaults() -> None:
    """It would pass over that, and fly by its airframe's: seen with PX4, whose '+' had the rotors of an 'x'."""
    lines = px4_file(load_vehicle("hummingbird").replace("sensors.gps.delay_s", 0.11), "by a test").splitlines()
    texts = {fields[2]: fields[3] for fields in (line.split("\t") for line in lines if not line.startswith("#"))}
    assert [texts[f"CA_ROTOR{i}_{axis}"] for i in range(4) for axis in ("PX", "PY")] == [
        *("1e-06", "0.171", "1e-06", "-0.171", "0.171", "1e-06", "-0.171", "1e-06")
    ]
    assert [texts[name] for name in PX4_DELAYS] == ["111"] * 3


@pytest.mark.parametrize("name", NAMES)
def test_the_file_for_ardupilot_is_one_of_mavproxy(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vehicle, path, found = load_vehicle(name), tmp_path / "vehicle.parm", MAVParmDict()
    path.write_text(ardupilot_file(vehicle, "by a test"), encoding="utf-8")
    wanted = ardupilot_parameters(vehicle)
    assert found.load(str(path))
    assert capsys.readouterr().out == f"Loaded {len(wanted)} parameters from {path}\n"
    assert dict(found) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("whom", FILES)
@pytest.mark.parametrize(
    ("key", "value", "why"),
    [
        ("rotors.strength", (1.0, 1.0, 0.85, 1.0), "rotors.strength: PX4 and ArduPilot take all rotors to be alike"),
        ("body.mass_kg", 1.7, r"hover thrust is 0.85., and M.._TH.*_HOVER is 0.1.* to 0.*"),
        ("body.mass_kg", 0.15, r"hover thrust is 0.0.*, and M.._TH.*_HOVER is 0.1.* to 0.*"),
        ("sensors.gps.delay_s", 0.31, r"sensors.gps.delay_s in ms is 310, and .*DELAY.* is 0 to [23].0"),
    ],
)
def test_a_vehicle_that_they_have_no_parameters_for_is_refused(whom: str, key: str, value: object, why: str) -> None:
    vehicle = load_vehicle("hummingbird").replace(key, value)
    with pytest.raises(VehicleError, match=why) as refused:
        FILES[whom](vehicle, "")
    assert "\n" not in str(refused.value)


def test_rotors_that_idle_fast_are_refused_for_ardupilot_alone() -> None:
    vehicle = load_vehicle("hummingbird")
    fast = msgspec.structs.replace(vehicle, rotors=msgspec.structs.replace(vehicle.rotors, idle_speed=300.0))
    with pytest.raises(VehicleError, match=r"MOT_SPIN_MIN is at most 0\.3, not 0\.36"):
        ardupilot_parameters(fast)
    assert px4_parameters(fast) == px4_parameters(vehicle)


@pytest.mark.parametrize("axis", [(), tuple((0.1 * side, 0.0, 1.0) for side in (1, -1, 1, -1))])
def test_px4_alone_flies_frames_of_any_shape(axis: tuple[Vector, ...]) -> None:
    turned = ((0.16, 0.06, 0.02), (0.06, -0.16), (-0.16, -0.06), (-0.06, 0.16))
    vehicle = load_vehicle("hummingbird").replace("rotors.position_m", turned).replace("rotors.axis", axis)
    values = px4_parameters(vehicle)
    assert [values[f"CA_ROTOR0_P{letter}"] for letter in "XYZ"] == [0.16, -0.06, -0.02]
    assert ("CA_ROTOR1_AX" in values) == bool(axis)
    with pytest.raises(VehicleError, match="not those of a frame"):
        FILES["ardupilot"](vehicle, "")
