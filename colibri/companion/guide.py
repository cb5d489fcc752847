"""The companion without socket or clock: bytes and time in, bytes out."""

from math import dist, inf, nan
from typing import Any

from colibri.autopilot.control.interface import Clock
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.registry import DecisionError, Factory
from colibri.autopilot.ground.snapshots import first
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.common.rotations import tilt_deg
from colibri.companion.orders import Orders
from colibri.companion.setpoints import LogRow, TrackErrors, message_of, row_of
from colibri.companion.settings import CompanionSettings
from colibri.companion.stack import Response, Thrust
from colibri.companion.steering.law_pilot import LawDemand, LawPilot
from colibri.companion.steering.predictor import Predictor
from colibri.companion.steering.references import PastReference, ReferenceHistory, StepFlight, smoothly_started
from colibri.companion.supervision import rules
from colibri.companion.supervision.phases import (
    WITHIN_S,
    CompanionEnd,
    CompanionPhase,
    Consistency,
    PhaseCondition,
    SetpointRate,
    how_it_ended,
    next_phase,
)
from colibri.companion.vehicle_peer import ReceivedState, VehiclePeer, moved_m
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.description import Vehicle

_GUESSED = Response((0.03, 0.03, 0.12), 0.02, 0.03, (3.8, 3.8, 2.0), (15.0, 15.0, 4.0))
"""Assumed until the stack is recognised."""
_STEADY_US = 1_000_000  # hold after the take-over, and streaming before it
_BRAKES_US = 3_000_000  # longest braking before the hand-over
_SLOW_M_S = 0.3
_UP_M, _UP_M_S = 0.5, 0.3
_CORRECTED_IN = 0.5  # time constant of the prediction's correction, in round trips


class Companion:
    """Flies one vehicle; the readers of `said` and `rows` clear them."""

    def __init__(
        self,
        settings: CompanionSettings,
        profile: Profile,
        vehicle: Vehicle,
        track: Track,
        clock: Clock,
        law: Factory | None = None,
    ) -> None:
        self._settings, self._vehicle = settings, vehicle
        self._duration_s = min(settings.duration_s, track.duration_s)
        self.peer = VehiclePeer(settings.stack, settings.system)
        self._response = settings.response or (settings.stack.response if settings.stack else _GUESSED)
        track = smoothly_started(track)
        self._pilot = LawPilot(profile, vehicle, track, self._response, clock, law)
        self._predictor = Predictor(vehicle, self._response)
        self._predictor.thrust_scale = settings.thrust_scale
        self._history = ReferenceHistory()
        self._orders = Orders(self.peer, settings, self._pilot.start_enu_m[2])
        self._box = rules.box_of(track, settings.duration_s, settings.limits.margin_m)
        self._weight_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
        self._thrust: Thrust | None = None
        self.phase, self._since_us = CompanionPhase.CONNECTING, 0
        self._began_us: int | None = None
        self._next_us = 0
        self._newest: ReceivedState | None = None
        self._asked: LawDemand | None = None
        self._consistency = Consistency()
        self._law_error = self._fault = ""
        self._passed_us: int | None = None
        self._pace = SetpointRate()
        self._stopped = self._brakes = self._on_way = self.has_flown = False
        self.failing: list[str] = ["clock"]
        self.ended: CompanionEnd | None = None
        self.limit: rules.Rule[rules.FlightFacts] | None = None
        self.errors = TrackErrors()
        self.said: list[str] = []
        self.rows: list[LogRow] = []
        self.steps = StepFlight() if settings.identifies else None

    @property
    def interval_us(self) -> int:
        return self._pilot.interval_us

    @property
    def thrust_scale(self) -> float:
        """Actual over commanded thrust, refined in flight."""
        return self._predictor.thrust_scale

    @property
    def waits_for(self) -> list[str]:
        if self.phase is CompanionPhase.CONNECTING:
            return ["waits for a HEARTBEAT"] if self.peer.system == 0 else ["waits for the vehicle's parameters"]
        if self.phase is not CompanionPhase.CHECKING:
            return []
        if self.failing or self._settings.dry_run or self._settings.may_arm:
            return self.failing
        return ["all is checked: waits for a vehicle that flies, in a mode that holds or takes setpoints"]

    @property
    def completed(self) -> bool:
        return self._brakes

    def last_order(self) -> list[bytes]:
        """Return the order to hold, after an error."""
        stack = self.peer.stack
        if stack is None or not self.has_flown:
            return []
        fields = (*self.peer.target, mav.MAV_CMD_DO_SET_MODE, 0, *stack.hold.command, 0.0, 0.0, 0.0, 0.0)
        return [self.peer.client.encode("COMMAND_LONG", *fields)]

    def stop(self, why: str, *, fault: bool = False) -> None:
        """Hand over, or never begin; after a `fault` the flight has not ended in order."""
        if not self._stopped:
            self.said.append(why)
        self._fault = self._fault or (why if fault else "")
        self._stopped = True

    def receive(self, datagram: bytes, now_us: int) -> None:
        for received in self.peer.receive(datagram, now_us):
            self._take_in(received)

    def poll(self, now_us: int) -> list[bytes]:
        if self._began_us is None:
            self._began_us = self._since_us = self._next_us = now_us
        if self.ended is not None:
            return []
        if self._thrust is None:
            self._adopt_stack()
        self._advance(now_us)
        frames = []
        if now_us >= self._next_us:
            self._next_us += (1 + (now_us - self._next_us) // self.interval_us) * self.interval_us
            frames = self._setpoint(now_us)
        self._orders.poll(self.phase, now_us - self._since_us, ready=self._may_hand_over(now_us))
        return self.peer.poll(now_us) + frames

    def _take_in(self, received: ReceivedState) -> None:
        at_us, state = received
        if self._newest is not None and at_us <= self._newest.at_us:
            return
        self._newest = received
        self._consistency.add(at_us, state)
        self._predictor.corrected_in_s = _CORRECTED_IN * self.peer.clock.round_trip_us * 1e-6
        self._predictor.observe(at_us, state)
        if self.steps is not None:
            self.steps.add(at_us, state)
        past = self._history.at(at_us)
        if self.phase is CompanionPhase.FLYING and past is not None and past.track_enu_m is not None:
            self.errors.add(past.track_s, past.track_enu_m, state.position_enu_m)

    def _adopt_stack(self) -> None:
        stack, parameters = self.peer.stack, self.peer.parameter_values
        if stack is None or parameters is None:
            return
        self._thrust = stack.thrust(parameters, self._vehicle)
        self._response = self._settings.response or stack.response
        self._pilot.adopt(self._response)
        self._predictor.adopt(self._vehicle, self._response)

    def _age_s(self, now_us: int) -> float:
        return inf if self._newest is None else (now_us - self._newest.at_us) * 1e-6

    def _acts_us(self, now_us: int) -> int:
        return now_us + self.peer.clock.round_trip_us // 2 + round(self._response.latency_s * 1e6)

    def _advance(self, now_us: int) -> None:
        self._look(now_us)
        while self.ended is None:
            after, why = next_phase(self.phase, self._conditions(now_us))
            if why is None:
                return
            self._enter(after, why, now_us)

    def _look(self, now_us: int) -> None:
        if self.phase is CompanionPhase.CHECKING:
            if self._settings.stay is not None and self._newest is not None:
                place = self._settings.stay.place(self._newest.state.position_enu_m)
                self._box = rules.FlightRegion(place, place).around(place, self._settings.limits.margin_m)
            start = self._check_facts(now_us)
            self.failing = rules.failing(start)
            self.peer.reports_are_old = bool(rules.too_old(start.ages, in_flight=False))
            if self._settings.dry_run:
                self._rehearse(now_us)
        elif (
            self.phase in (CompanionPhase.TAKING_OFF, CompanionPhase.TAKING_OVER, CompanionPhase.FLYING)
            and self.limit is None
        ):
            facts = self._flight_facts(now_us)
            self.limit = rules.exceeded(facts)
            if self.limit is not None:
                self.said.append(f"{self.limit.name}: {self.limit.words(facts)}")
        self._consistency.jumped_m = 0.0

    def _rehearse(self, now_us: int) -> None:
        if self._law_error:
            self.failing.append(f"control law: {self._law_error}")
        elif not self.failing and self._pace.kept(now_us, self.interval_us) < self._settings.limits.min_pace:
            self.failing.append("overloaded: this computer is too slow for the control law")
        if self._passed_us is None and not self.failing:
            self._passed_us = now_us
            self.said.append("all checks passed: the law runs, nothing is sent")

    def _conditions(self, now_us: int) -> frozenset[PhaseCondition]:
        report, stack = self.peer.report, self.peer.stack
        waited_s = (self._since_us - (self._began_us or 0)) * 1e-6
        gives_up_s = self._settings.gives_up_s - waited_s if self._passed_us is None else inf
        within_s = inf if self.phase is CompanionPhase.FLYING else WITHIN_S.get(self.phase, gives_up_s)
        found = {
            PhaseCondition.STOPPED: self._stopped or self._orders.refused != "",
            PhaseCondition.MUST_END: self.limit is not None,
            PhaseCondition.CONNECTED: self.peer.connected and self._thrust is not None,
            PhaseCondition.FINISHED: self._finished(now_us),
            PhaseCondition.TOO_LATE: (now_us - self._since_us) * 1e-6 > within_s,
        }
        if stack is not None:
            offboard, armed = report.mode == stack.offboard.custom, report.armed or self._orders.disarms
            checked = not self.failing and not self._settings.dry_run
            flies = armed and report.airborne is not False
            may_arm = self._settings.may_arm and report.airborne is not True
            found |= {
                PhaseCondition.OFFBOARD: offboard,
                PhaseCondition.HELD: self._orders.held,
                PhaseCondition.PILOT: report.mode not in self._orders.own_modes(self.phase),
                PhaseCondition.ARMED: armed,
                PhaseCondition.DISARMED: not armed,
                PhaseCondition.UP: self._is_up(),
                PhaseCondition.CHECKED_IN_AIR: checked and flies and (offboard or report.mode in stack.steady),
                PhaseCondition.CHECKED_TO_ARM: checked and not flies and may_arm,
            }
        return frozenset(condition for condition, holds in found.items() if holds)

    def _is_up(self) -> bool:
        if self._newest is None or not self.peer.report.armed or not self._orders.climbed:
            return False
        state = self._newest.state
        off_m = abs(state.position_enu_m[2] - self._orders.height_enu_m)
        return off_m < _UP_M and abs(state.velocity_enu_m_s[2]) < _UP_M_S

    def _finished(self, now_us: int) -> bool:
        if self._settings.dry_run:
            return self._passed_us is not None and (now_us - self._passed_us) * 1e-6 >= self._duration_s
        if not self._on_way or self._asked is None:
            return False
        if self.steps is not None:
            return self.steps.is_over(now_us)
        return self._pilot.finished or self._asked.track_s >= self._settings.duration_s

    def _enter(self, phase: CompanionPhase, why: PhaseCondition, now_us: int) -> None:
        waits_for = self.waits_for
        before, self.phase, self._since_us = self.phase, phase, now_us
        self.said.append(f"{phase}: {self._orders.refused or why.value}")
        if before is CompanionPhase.CHECKING:
            self.said += rules.failing(self._check_facts(now_us), required=False)
        if phase is CompanionPhase.CHECKING:
            self._pace.begin(now_us)
        if self._newest is not None and before is CompanionPhase.CHECKING and phase is not CompanionPhase.ENDED:
            x, y, z = self._newest.state.position_enu_m
            self._orders.set_ground(z)
            here = (x, y, z) if phase is CompanionPhase.TAKING_OVER else (x, y, self._orders.height_enu_m)
            margin_m = self._settings.limits.margin_m
            for place in ((x, y, z), here):
                self._box = self._box.around(place, margin_m)
        self._orders.enter(phase, before)
        if phase is CompanionPhase.FLYING:
            self._pace.begin(now_us)
            self._predictor.begin()
            self._predictor.observe(self._newest.at_us, self._newest.state) if self._newest else None
            self._pilot.begin(self._predictor.at(self._acts_us(now_us)))
            self._on_way, self.has_flown, self._predictor.learns = False, True, True
        elif phase is CompanionPhase.HANDING_OVER:
            self._pilot.hold()
            self._brakes = why is PhaseCondition.FINISHED
        elif phase is CompanionPhase.ENDED:
            fault = self._orders.refused or self._fault
            if why is PhaseCondition.PILOT and self.peer.report.system_status in rules.CRITICAL:
                fault = fault or f"the vehicle reports an emergency (system status {self.peer.report.system_status})"
            elif self._settings.dry_run and before in (CompanionPhase.CONNECTING, CompanionPhase.CHECKING):
                fault = fault or "; ".join(waits_for)
            self.ended = how_it_ended(before, why, self.limit, fault, waits_for)

    def _may_hand_over(self, now_us: int) -> bool:
        if not self._brakes or self._newest is None or self.limit is not None or self._stopped:
            return True
        slow = dist(self._newest.state.velocity_enu_m_s, (0.0, 0.0, 0.0)) < _SLOW_M_S
        return slow or now_us - self._since_us > _BRAKES_US

    def _setpoint(self, now_us: int) -> list[bytes]:
        rehearses = self._settings.dry_run and self.phase is CompanionPhase.CHECKING
        blind = self.limit is not None and self.limit.blind
        flies = self.has_flown and self.phase in (CompanionPhase.FLYING, CompanionPhase.HANDING_OVER) and not blind
        if (
            self._thrust is None
            or self._newest is None
            or not (flies or rehearses or self.phase is CompanionPhase.TAKING_OVER)
        ):
            return []
        if self.phase is CompanionPhase.HANDING_OVER and self._age_s(now_us) > self._settings.limits.max_state_age_s:
            return []
        acts_us = self._acts_us(now_us)
        if rehearses or self.phase is CompanionPhase.TAKING_OVER:
            self._pilot.begin(self._predictor.at(acts_us))
        if self.phase is CompanionPhase.FLYING and not self._on_way and now_us - self._since_us >= _STEADY_US:
            self._on_way = True
            if self.steps is None:
                self._pilot.fly_track(self._settings.stay)
            else:
                self.steps.begin(self._since_us + _STEADY_US)
        y = self._predictor.at(acts_us)
        try:
            asked = self._pilot.step(y)
        except DecisionError as error:
            self._law_error = str(error)
            return []
        self._pace.count(now_us)
        if asked.reference is not None:
            self._asked = asked
            place = first(asked.reference.position_enu_m)
            self._history.add(PastReference(acts_us, place, asked.track_enu_m, asked.track_s))
        if self.phase is CompanionPhase.TAKING_OVER and not rehearses:
            asked = asked._replace(rate_flu_rad_s=(0.0, 0.0, 0.0), thrust_n=self._weight_n)
        if self.phase is CompanionPhase.FLYING and self.steps is not None:
            arrives_us = now_us + self.peer.clock.round_trip_us // 2
            rates = self.steps.rates(asked.rate_flu_rad_s, now_us, arrives_us)
            asked = asked._replace(rate_flu_rad_s=rates)
        thrust = self._thrust.command(asked.thrust_n / (self._weight_n * self._predictor.thrust_scale))
        if flies:
            lift = (
                self._thrust.load(thrust) * self._weight_n * self._predictor.thrust_scale / self._vehicle.body.mass_kg
            )
            self._predictor.sent(acts_us, asked.rate_flu_rad_s, lift)
        assert self._asked is not None, "a law has decided"
        head = (now_us * 1e-6, self.phase.value, self._age_s(now_us), self.peer.clock.round_trip_us * 1e-6)
        self.rows.append(row_of(head, asked, self._asked, thrust, y, self._predictor, sent=not rehearses))
        if rehearses:
            return []
        kind, target = self._settings.setpoints, self.peer.target
        name, fields = message_of(kind, now_us, target, asked, self._asked, thrust, y)
        return [self.peer.client.encode(name, *fields)]

    def _facts(self, now_us: int) -> dict[str, Any]:
        peer = self.peer
        return {
            "report": peer.report,
            "state_age_s": self._age_s(now_us),
            "ages": rules.ages_s(peer.report, peer.clock.answered_us, now_us),
            "contradiction": self._consistency.contradiction,
            "limits": self._settings.limits,
            "box": self._box,
        }

    def _check_facts(self, now_us: int) -> rules.CheckFacts:
        peer = self.peer
        assert peer.stack is not None, "it is connected"
        return rules.CheckFacts(
            **self._facts(now_us),
            stack=peer.stack,
            systems=tuple(peer.client.vehicles),
            home_moved_m=moved_m(self._settings.home, peer.report),
            thrust=self._thrust,
            parameters=peer.parameter_values,
            clock_known=peer.clock.known,
            clock_rate=peer.clock.rate,
            round_trip_s=peer.clock.round_trip_us * 1e-6,
            state_rate_hz=peer.state_rate_hz(now_us),
            state_delay_s=peer.state_delay_s,
            mode_rate_hz=peer.report.mode_rate_hz(now_us),
            may_arm=self._settings.may_arm,
            approach_m=self._approach_m(),
        )

    def _approach_m(self) -> float:
        if self._newest is None:
            return nan
        here, stay = self._newest.state.position_enu_m, self._settings.stay
        return dist(here, self._pilot.start_enu_m if stay is None else stay.place(here))

    def _flight_facts(self, now_us: int) -> rules.FlightFacts:
        newest, flies = self._newest, self.phase is CompanionPhase.FLYING
        place = newest.state.position_enu_m if newest else (nan, nan, nan)
        past = self._history.at(newest.at_us) if newest and flies else None
        return rules.FlightFacts(
            **self._facts(now_us),
            position_enu_m=place,
            tilt_deg=tilt_deg(newest.state.attitude) if newest else 0.0,
            error_m=dist(past.position_enu_m, place) if past else 0.0,
            jumped_m=self._consistency.jumped_m,
            law_error=self._law_error,
            pace=self._pace.kept(now_us, self.interval_us) if flies else 1.0,
            gap_s=self._pace.gap_s(now_us) if flies else 0.0,
        )
