"""The report of a control sample: arming inputs to the pilot, the snapshot to ground stations."""

from typing import NamedTuple

from colibri.autopilot.commander.flight.reference_generator import Guidance
from colibri.autopilot.commander.rules.arming import ArmingInputs, battery_fault
from colibri.autopilot.commander.rules.failsafe_table import Condition
from colibri.autopilot.commander.rules.modes import MANUAL
from colibri.autopilot.control.interface import Decision, VehicleState
from colibri.autopilot.core.parts import Parts
from colibri.autopilot.estimation.health import HealthWatch, not_known


class Sample(NamedTuple):
    """A control sample; no decision while the rotors stand or idle, and the duration of the computation."""

    now_us: int
    state: VehicleState
    guidance: Guidance
    decision: Decision | None
    duration_s: float


class Reporter:
    """Reports the control samples of one vehicle.

    Attributes:
        samples: How many were reported.
    """

    def __init__(self, parts: Parts) -> None:
        """Report of a vehicle of these parts."""
        self._parts = parts
        self._health = HealthWatch()
        self._interval_s = parts.loop.control_interval_us * 1e-6
        self.samples = 0

    def report(self, sample: Sample) -> None:
        """Report a control sample."""
        parts, pilot, stations = self._parts, self._parts.pilot, self._parts.stations
        now_us, state, guidance, decision, duration_s = sample
        self.samples += 1
        pilot.readiness.update(self._arming_inputs(now_us, state))
        estimate = parts.state_source.estimate
        if estimate is not None:
            for severity, line in self._health.lines(estimate.health):
                stations.say(severity, line)
        controls = parts.actuation.turning(now_us, armed=pilot.state.armed)
        parts.battery.run(controls, self._interval_s)
        stations.missions.watch_mode(pilot.state.mode)
        battery = parts.battery.state()
        if battery is not None:
            battery = battery._replace(charge_state=parts.supervisor.charge_state)
        snapshot = parts.snapshots.take(
            now_us, state, pilot, guidance, decision, duration_s, controls, battery, stations, parts.state_source
        )
        stations.update(snapshot)

    def _arming_inputs(self, now_us: int, state: VehicleState) -> ArmingInputs:
        """Return the inputs of the arming checks."""
        parts, pilot = self._parts, self._parts.pilot
        sticks, estimate = pilot.sensed.steered.sticks, parts.state_source.estimate
        return ArmingInputs(
            state,
            pilot.ground.standing,
            parts.battery.left,
            sticks.thrust if sticks is not None and pilot.state.mode in MANUAL else None,
            parts.stations.fence.breach(state.position_enu_m, now_us),
            not_known(estimate.health) if estimate is not None else "",
            self._battery_fault(),
        )

    def _battery_fault(self) -> str:
        """Return why nobody may take off on the battery, apart from its charge; empty if one may."""
        battery, model = self._parts.battery.state(), self._parts.loop.vehicle.battery
        if battery is None or model is None:
            return ""
        if any(map(self._parts.supervisor.holds, (Condition.BATTERY_EMERGENCY, Condition.BATTERY_CRITICAL))):
            return f"battery critical: {battery.voltage_v:.1f} V"
        return battery_fault(battery.voltage_v, model.empty_voltage_v, model.full_voltage_v)
