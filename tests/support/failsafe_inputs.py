"""Inputs of the failsafes' conditions for a vehicle that is well."""

from colibri.autopilot.commander.rules.failsafe_conditions import NEVER_US, FailsafeInputs
from colibri.autopilot.commander.rules.failsafe_table import Condition
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.interface import Diagnostics, Fallback
from colibri.autopilot.guidance.integrator_chain import Limits
from colibri.mavlink.telemetry.snapshot import BatteryState
from tests.support.cockpit import FLYING, at

FULL = BatteryState(3, 12.0, 5.0, 0.1, 0.9, 600.0, 1.0)
WELL = FailsafeInputs(
    now_us=10_000_000,
    missed_us=None,
    state=at(FLYING),
    mode=Mode.HOLD,
    standing=False,
    estimate=None,
    setpoint=None,
    sticks_us=None,
    listening_us=NEVER_US,
    station_us=None,
    battery=FULL,
    fence=None,
    decided=Diagnostics(),
    late=False,
    rotor_lost=None,
    pace=Limits(),
)

LOST: dict[Condition, FailsafeInputs] = {
    Condition.TILTED: WELL._replace(state=WELL.state._replace(euler=(1.5, 0.0, 0.0))),
    Condition.ROTOR_FAILED: WELL._replace(rotor_lost=0),
    Condition.BATTERY_EMERGENCY: WELL._replace(battery=FULL._replace(remaining=0.01)),
    Condition.BATTERY_CRITICAL: WELL._replace(battery=FULL._replace(remaining=0.06)),
    Condition.BATTERY_LOW: WELL._replace(battery=FULL._replace(remaining=0.14)),
    Condition.PLAN_FAILED: WELL._replace(decided=Diagnostics(fallback=Fallback.LQR)),
    Condition.STATION_LOST: WELL._replace(station_us=0),
    Condition.FENCE_BREACHED: WELL._replace(fence=lambda _: -5.0),
    Condition.DEADLINE_MISSED: WELL._replace(late=True),
}
"""Inputs by which a condition has held for long, or holds from now on."""
