"""Supervision at each control sample: lost rotors, setpoints of clients, failsafes."""

from collections.abc import Mapping
from types import MappingProxyType

from colibri.autopilot.commander.pilot import Sensed
from colibri.autopilot.commander.rules.failsafe_conditions import NEVER_US, FailsafeInputs
from colibri.autopilot.commander.rules.failsafe_table import Action, Condition
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.interface import VehicleState
from colibri.autopilot.core.defence import table
from colibri.autopilot.core.parts import Parts
from colibri.autopilot.guidance.tasks.task import NOT_STEERED, ClientInputs

_EVER_US = 10**15
_LANDS = (Mode.LAND, Mode.RETURN)
_NOTHING: Mapping[Condition, str] = MappingProxyType({})
_KNOWN_TILT_RAD, _CATCHING_US = 0.035, 3_000_000
"""A vehicle caught in a fall drifts until its tilt is known so well, or for so long."""


class Supervision:
    def __init__(self, parts: Parts) -> None:
        self._parts, self._guard = parts, parts.defence.guard
        self._missed_us: int | None = None
        self._listening_us = NEVER_US
        self._doubts = False
        self._caught_us: int | None = None

    def listen(self, now_us: int) -> None:
        """Count the loss of clients from a restart on."""
        self._listening_us = now_us

    def catch(self, now_us: int) -> None:
        """Have a vehicle found falling drift at first: to brake, its attitude must be known."""
        self._caught_us = now_us

    def miss(self, since_us: int | None) -> None:
        if self._missed_us is None:
            self._missed_us = since_us

    def step(self, now_us: int, state: VehicleState) -> None:
        """Update the pilot's inputs, and have the pilot execute the failsafe that is due."""
        parts, guard = self._parts, self._guard
        guard(table.ROTOR_WATCH, self._watch_rotors, table.nothing, state)
        steered, position_known = guard(table.SETPOINTS, self._sensed, lambda: (NOT_STEERED, True), now_us)
        delay_us = 0 if table.DELAY in parts.defence.off else parts.delay.delay_us
        waited_us, path_speed = parts.loop.take_waited_us(), parts.loop.path_speed
        lift, push, jolt_s, watch = None, 0.0, 0.0, parts.rotor_loss.watch
        estimate = parts.state_source.estimate
        if self._doubts:
            lift, push = watch.expected[2] / parts.loop.vehicle.gravity_m_s2, watch.push
            if estimate is not None and estimate.health.accelerometer and not estimate.health.gyroscope:
                jolt_s = watch.jolt_s
        drifts = not position_known or (estimate is not None and not estimate.speed_known)
        parts.pilot.sense(
            Sensed(now_us, state, steered, position_known, delay_us, waited_us, path_speed, lift, push, jolt_s, drifts)
        )
        guard(table.FAILSAFES, self._execute, table.nothing, now_us, state)
        if self._caught_us is not None:
            self._drift(now_us, self._caught_us, state)
        self._missed_us = None

    def _drift(self, now_us: int, caught_us: int, state: VehicleState) -> None:
        self._parts.pilot.generator.drift(state)
        estimate = self._parts.state_source.estimate
        known = estimate is None or max(estimate.attitude_std_rad[:2]) < _KNOWN_TILT_RAD
        if known or now_us - caught_us > _CATCHING_US:
            self._caught_us = None

    def _execute(self, now_us: int, state: VehicleState) -> None:
        supervisor, pilot = self._parts.supervisor, self._parts.pilot
        action = supervisor.step(self._inputs(now_us, state), pilot.flight)
        if action is not Action.NONE:
            pilot.save(action)
        lands = pilot.saving is not Action.NONE and supervisor.holds(Condition.GYROSCOPE_LOST)
        pilot.readiness.unsteady = Condition.GYROSCOPE_LOST.value if lands else ""

    def _sensed(self, now_us: int) -> tuple[ClientInputs, bool]:
        parts = self._parts
        return parts.stations.needs.steered(now_us), parts.supervisor.position_known(parts.state_source.estimate)

    def _watch_rotors(self, state: VehicleState) -> None:
        parts, pilot = self._parts, self._parts.pilot
        estimate, rotor_loss = parts.state_source.estimate, parts.rotor_loss
        if not pilot.state.armed:
            rotor_loss.end()
        feels = estimate is None or (estimate.health.gyroscope and estimate.health.accelerometer)
        if estimate is not None and (estimate.health.any_lost or self._doubts):
            self._doubts = pilot.state.armed
        airborne = feels and pilot.state.armed and not pilot.ground.standing
        sent, charge_ah = parts.actuation.sent, parts.battery.charge_ah
        if rotor_loss.look(state, sent, charge_ah, airborne=airborne, ground_m=pilot.ground.height_m):
            assert rotor_loss.lost is not None, "what is lost has a number"
            pilot.readiness.lose_rotor(rotor_loss.lost, rotor_loss.remaining, lands=rotor_loss.landing_for is not None)
        if not feels or parts.state_source.shaken:
            parts.state_source.help_inertial(rotor_loss.watch.expected, armed=pilot.state.armed)

    def _inputs(self, now_us: int, state: VehicleState) -> FailsafeInputs:
        parts, pilot, stations = self._parts, self._parts.pilot, self._parts.stations
        fence = stations.fence if stations.fence.exists else None
        if fence is not None:
            height_m = state.position_enu_m[2] - pilot.home.position_enu_m[2]
            fence.watch_floor(height_m, lands=pilot.ground.standing or pilot.state.mode in _LANDS)
        sticks = stations.manual.latest(now_us, _EVER_US)
        decision = parts.actuation.decision
        return FailsafeInputs(
            now_us=now_us,
            missed_us=self._missed_us,
            state=state,
            mode=pilot.state.mode,
            standing=pilot.ground.standing,
            estimate=parts.state_source.estimate,
            setpoint=stations.offboard.latest(now_us, _EVER_US),
            sticks_us=None if sticks is None else sticks.time_us,
            listening_us=self._listening_us,
            station_us=stations.heartbeat.station_us,
            battery=parts.battery.state(),
            fence=None if fence is None else fence.margin_m,
            decided=None if decision is None else decision.diagnostics,
            late=pilot.behaviour.solve_time_s * 1e6 > parts.loop.control_interval_us,
            rotor_lost=parts.rotor_loss.landing_for,
            pace=pilot.behaviour.limits,
            needs_radio=stations.exempt is not None,
            exempt=_NOTHING if stations.exempt is None else stations.exempt(),
            caught=self._caught_us is not None,
        )
