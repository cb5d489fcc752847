"""Inputs of the failsafes' conditions for a vehicle that is well."""

from colibri.autopilot.commander.rules.failsafe_conditions import NEVER_US, FailsafeInputs
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.interface import Diagnostics
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
