"""The report of a control sample: arming inputs to the pilot, the snapshot to ground stations."""

from colibri.autopilot.commander.rules.arming import VOLTAGE_OF, ArmingInputs
from colibri.autopilot.commander.rules.modes import MANUAL
from colibri.autopilot.control.interface import Decision, VehicleState
from colibri.autopilot.core.autopilot import ControlSample
from colibri.autopilot.core.parts import Parts
from colibri.autopilot.estimation.estimate import Estimate
from colibri.autopilot.estimation.health import HealthWatch, not_known
from colibri.mavlink.wire.dialect import Refusal, mav

_CRITICAL = (mav.MAV_BATTERY_CHARGE_STATE_CRITICAL, mav.MAV_BATTERY_CHARGE_STATE_EMERGENCY)


class Reporter:
    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._health = HealthWatch()
        self._interval_s = parts.loop.control_interval_us * 1e-6
        self.samples = 0  # control samples reported so far

    def report(self, sample: ControlSample, decision: Decision | None, duration_s: float) -> None:
        parts, pilot, stations = self._parts, self._parts.pilot, self._parts.stations
        now_us, state, guidance = sample.now_us, sample.state, sample.guidance
        self.samples += 1
        estimate, charge_state = parts.state_source.estimate, parts.supervisor.charge_state
        fence = stations.fence
        breach = fence.breach(state.position_enu_m, now_us, parts.supervisor.limits["GF_MARGIN"])
        pilot.readiness.inputs = self._arming_inputs(state, estimate, fence.against_arming, charge_state)
        if estimate is not None:
            for severity, line in self._health.lines(estimate.health):
                stations.say(severity, line)
        controls = parts.actuation.turning(now_us, armed=pilot.state.armed)
        parts.battery.run(controls, self._interval_s)
        stations.missions.watch_mode(pilot.state.mode)
        if not stations.reports:
            return
        snapshot = parts.snapshots.take(
            *(now_us, state, pilot, guidance, decision, duration_s, controls),
            *(parts.battery.state(charge_state), fence, parts.state_source, stations.modes),
            breached=breach is not None,
        )
        stations.update(snapshot)

    def _arming_inputs(
        self, state: VehicleState, estimate: Estimate | None, outside_fence: Refusal | None, charge_state: int
    ) -> ArmingInputs:
        parts, pilot = self._parts, self._parts.pilot
        sticks = pilot.sensed.steered.sticks
        return ArmingInputs(
            state,
            pilot.ground.standing,
            parts.battery.left,
            sticks.thrust if sticks is not None and pilot.state.mode in MANUAL else None,
            outside_fence,
            not_known(estimate.health) if estimate is not None else "",
            self._battery_fault(charge_state),
        )

    def _battery_fault(self, charge_state: int) -> str:
        """Return the reason against a take-off on the battery, apart from its charge."""
        voltage_v, model = self._parts.battery.voltage_v, self._parts.battery.battery
        if model is None:
            return ""
        if charge_state in _CRITICAL:
            return f"battery critical: {voltage_v:.1f} V"
        minimum, maximum = VOLTAGE_OF
        healthy = minimum * model.empty_voltage_v <= voltage_v <= maximum * model.full_voltage_v
        return "" if healthy else f"battery unhealthy: {voltage_v:.1f} V"
