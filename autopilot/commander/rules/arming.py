"""The arming checks."""

from collections.abc import Iterator

from colibri.autopilot.control.interface import VehicleState
from colibri.common.records import Record
from colibri.common.rotations import tilt_deg
from colibri.mavlink.wire.dialect import Refusal

MAX_TILT_DEG = 45.0
MAX_SPEED_M_S = 0.5
MIN_CHARGE = 0.1  # part of the battery's charge
VOLTAGE_OF = (0.5, 1.2)  # bounds of a healthy voltage, relative to the empty and the full voltage
MAX_THRUST_STICK = 0.6
_SURELY_LEVEL = 0.1  # x² + y² of a quaternion at 37 degrees of tilt, below which the slow arc cosine is skipped


class ArmingInputs(Record, frozen=True):
    """Inputs of the arming checks; charge and stick are 0..1, texts are faults."""

    state: VehicleState | None
    standing: bool
    charge: float
    thrust_stick: float | None
    outside_fence: Refusal | None = None
    not_known: str = ""
    battery: str = ""


def refusals(inputs: ArmingInputs) -> Iterator[str]:
    state, stick = inputs.state, inputs.thrust_stick
    if state is None:
        yield "no telemetry from the plant"
        return
    _, x, y, _ = state.attitude
    if not x * x + y * y < _SURELY_LEVEL and (tilted_deg := tilt_deg(state.attitude)) > MAX_TILT_DEG:
        yield f"tilted by {tilted_deg:.0f} degrees, more than {MAX_TILT_DEG:.0f}"
    if (fastest_m_s := max(map(abs, state.velocity_enu_m_s))) > MAX_SPEED_M_S:
        yield f"moving at {fastest_m_s:.1f} m/s"
    if not inputs.standing:
        yield "not on the ground"
    if inputs.charge < MIN_CHARGE:
        yield f"battery low: {inputs.charge:.0%}"
    if inputs.battery:
        yield inputs.battery
    if stick is not None and stick > MAX_THRUST_STICK:
        yield "thrust stick is up"
    if inputs.outside_fence is not None:
        yield inputs.outside_fence.reason
    if inputs.not_known:
        yield inputs.not_known
