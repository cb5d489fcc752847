"""What must hold before the rotors may turn; every check says why it fails."""

from collections.abc import Callable
from typing import NamedTuple

from colibri.autopilot.control.interface import VehicleState
from colibri.common.rotations import tilt_deg
from colibri.mavlink.wire.refusal import Refusal

MAX_TILT_DEG = 45.0
MAX_SPEED_M_S = 0.5
MIN_CHARGE = 0.1
"""Part of the battery's charge."""
VOLTAGE_OF = (0.5, 1.2)
"""Of the voltages empty and full: outside of these bounds a battery is not what tells its voltage."""
MAX_THRUST_STICK = 0.6


class ArmingInputs(NamedTuple):
    """What the checks look at.

    Attributes:
        state: Of the vehicle; None before the first frame.
        standing: Whether it stands on the ground.
        charge: Part of the battery's charge that is left; 1 without a battery.
        thrust_stick: Of the pilot, 0..1; None if the mode takes none, or no pilot is heard.
        outside_fence: Why the vehicle may not be where it is; None if it may.
        not_known: What the estimator does not know well enough; empty if nothing.
        battery: Why the battery is not to be flown on, apart from its charge; empty if it is.
    """

    state: VehicleState | None
    standing: bool
    charge: float
    thrust_stick: float | None
    outside_fence: Refusal | None = None
    not_known: str = ""
    battery: str = ""


def _tilt(inputs: ArmingInputs) -> str:
    assert inputs.state is not None
    tilted_deg = tilt_deg(inputs.state.attitude)
    if tilted_deg <= MAX_TILT_DEG:
        return ""
    return f"tilted by {tilted_deg:.0f} degrees, more than {MAX_TILT_DEG:.0f}"


def _speed(inputs: ArmingInputs) -> str:
    assert inputs.state is not None
    fast = max(map(abs, inputs.state.velocity_enu_m_s))
    return f"moving at {fast:.1f} m/s" if fast > MAX_SPEED_M_S else ""


def _standing(inputs: ArmingInputs) -> str:
    return "" if inputs.standing else "not standing on the ground"


def _charge(inputs: ArmingInputs) -> str:
    return f"battery at {inputs.charge:.0%}" if inputs.charge < MIN_CHARGE else ""


def _battery(inputs: ArmingInputs) -> str:
    return inputs.battery


def _thrust_stick(inputs: ArmingInputs) -> str:
    high = inputs.thrust_stick is not None and inputs.thrust_stick > MAX_THRUST_STICK
    return "thrust stick is up" if high else ""


def _fence(inputs: ArmingInputs) -> str:
    return inputs.outside_fence.reason if inputs.outside_fence else ""


def _knows(inputs: ArmingInputs) -> str:
    return inputs.not_known


CHECKS: tuple[Callable[[ArmingInputs], str], ...] = (
    _tilt,
    _speed,
    _standing,
    _charge,
    _battery,
    _thrust_stick,
    _fence,
    _knows,
)


def battery_fault(voltage_v: float, empty_v: float, full_v: float) -> str:
    """Return why a battery of these voltages is not healthy; empty if it is."""
    minimum, maximum = (part * bound for part, bound in zip(VOLTAGE_OF, (empty_v, full_v), strict=True))
    return "" if minimum <= voltage_v <= maximum else f"battery not healthy: {voltage_v:.1f} V"


def refusals(inputs: ArmingInputs) -> list[str]:
    """Return why the rotors may not be armed; empty if they may."""
    if inputs.state is None:
        return ["no telemetry from the plant"]
    return [reason for check in CHECKS if (reason := check(inputs))]
