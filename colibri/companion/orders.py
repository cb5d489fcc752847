"""Commands of each phase."""

from math import nan

from colibri.companion.settings import CompanionSettings
from colibri.companion.stack import Stack, TakeOffOrder
from colibri.companion.supervision.phases import CompanionPhase
from colibri.companion.vehicle_peer import VehiclePeer
from colibri.mavlink.client.conversation import UNANSWERED
from colibri.mavlink.client.modes import FlightMode
from colibri.mavlink.wire.dialect import RESULT_ACCEPTED, RESULT_TEMPORARILY_REJECTED, mav

_STREAMS_FIRST_US = 1_000_000  # PX4 requires setpoints before offboard mode
_HOLD_TRIES = 3
_AGAIN_US = 400_000
_ABOVE_SEA = -1.0  # pitch, as sent by QGroundControl; PX4 ignores it
_LEAST_HEIGHT_M = 1.0


class Orders:
    """Sends the commands, and records refusals."""

    def __init__(self, peer: VehiclePeer, settings: CompanionSettings, track_height_m: float) -> None:
        self._peer, self._settings = peer, settings
        self._track_height_m = track_height_m
        self.height_enu_m = self._climb_m = track_height_m
        self._before = -1
        self._reached = False
        self._own: frozenset[int] = frozenset()
        self._asked_hold = self._again_us = self._in_phase_us = 0
        self._disarming = False
        self.refused = ""

    @property
    def disarms(self) -> bool:
        return self._disarming and "disarm" not in self._peer.results

    @property
    def climbed(self) -> bool:
        """Whether the take-off mode, if the stack has one, is over."""
        stack = self._peer.stack
        return stack is not None and (
            stack.take_off is TakeOffOrder.ARM_THEN_COMMAND or self._peer.report.mode == stack.hold.custom
        )

    @property
    def held(self) -> bool:
        stack = self._peer.stack
        return stack is not None and (self._taken(stack.hold) or self._taken(stack.last_resort))

    def enter(self, phase: CompanionPhase, before: CompanionPhase) -> None:
        stack = self._peer.stack
        if stack is None:
            return
        self._again_us = 0
        self._before, self._reached = self._peer.report.mode, False
        if phase in (CompanionPhase.ARMING, CompanionPhase.TAKING_OFF):
            self._own = stack.steady | {stack.offboard.custom}
        elif phase in (CompanionPhase.TAKING_OVER, CompanionPhase.FLYING):
            self._own = frozenset({stack.offboard.custom})
        elif phase is CompanionPhase.HANDING_OVER:
            self._peer.clear()
            self._own = frozenset({stack.hold.custom, stack.last_resort.custom})
            if before is CompanionPhase.ARMING:
                self._disarming = True
                self._peer.ask("disarm", mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)

    def own_modes(self, phase: CompanionPhase) -> frozenset[int]:
        """Return the modes that the companion caused, with the previous one until one is reported."""
        mode = self._peer.report.mode
        if mode in self._own:
            self._reached = True
        if phase is CompanionPhase.FLYING or self._reached:
            return self._own
        return self._own | {self._before}

    def poll(self, phase: CompanionPhase, in_phase_us: int, *, ready: bool) -> None:
        """Send the commands of a phase; hold only if `ready`."""
        stack, results = self._peer.stack, self._peer.results
        self._in_phase_us = in_phase_us
        if stack is None or self._settings.dry_run:
            return
        if phase is CompanionPhase.ARMING:
            self._arm(stack)
        elif phase is CompanionPhase.TAKING_OFF and stack.take_off is TakeOffOrder.ARM_THEN_COMMAND:
            self._once("take-off", mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan, 0.0, 0.0, self._climb_m)
        elif phase is CompanionPhase.TAKING_OVER and in_phase_us >= _STREAMS_FIRST_US:
            self._mode(stack.offboard)
        elif phase is CompanionPhase.HANDING_OVER and ready and self._peer.report.armed:
            last_try = self._asked_hold >= _HOLD_TRIES
            wanted = stack.last_resort if last_try else stack.hold
            if last_try:
                self.refused = f"{stack.hold.name} was refused {_HOLD_TRIES} times: {wanted.name} was requested"
            name = f"mode {wanted.name}"
            if results.get(name) not in (None, RESULT_ACCEPTED):
                self._asked_hold += 1
                self._peer.forget(name)
            self._mode(wanted)

    def _arm(self, stack: Stack) -> None:
        if stack.take_off is TakeOffOrder.COMMAND_THEN_ARM:
            above_sea_m = self._peer.report.altitude_amsl_m + self._climb_m
            first = "take-off"
            self._once(first, mav.MAV_CMD_NAV_TAKEOFF, _ABOVE_SEA, 0.0, 0.0, nan, nan, nan, above_sea_m)
        else:
            first = f"mode {stack.offboard.name}"
            self._once(first, mav.MAV_CMD_DO_SET_MODE, *stack.offboard.command)
        if self._peer.results.get(first) == RESULT_ACCEPTED:
            self._once("arming", mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def set_ground(self, ground_enu_m: float) -> None:
        asked_m = self._settings.takeoff_height_m
        climb_m = self._track_height_m - ground_enu_m if asked_m is None else asked_m
        self._climb_m = max(climb_m, _LEAST_HEIGHT_M)
        self.height_enu_m = ground_enu_m + self._climb_m

    def _mode(self, mode: FlightMode) -> None:
        if not self._taken(mode):
            self._repeat(f"mode {mode.name}", mav.MAV_CMD_DO_SET_MODE, *mode.command)

    def _taken(self, mode: FlightMode) -> bool:
        accepted = self._peer.results.get(f"mode {mode.name}") == RESULT_ACCEPTED
        return accepted and self._peer.report.mode == mode.custom

    def _once(self, name: str, number: int, *params: float) -> None:
        result = self._peer.results.get(name)
        if result is None:
            self._peer.ask(name, number, *params)
        elif result == RESULT_TEMPORARILY_REJECTED:
            self._repeat(name, number, *params)
        elif result != RESULT_ACCEPTED:
            said = "; ".join(self._peer.report.texts[-2:])
            how = "was not answered" if result == UNANSWERED else f"was refused (result {result})"
            self.refused = f"{name} {how}" + (f": {said}" if said else "")

    def _repeat(self, name: str, number: int, *params: float) -> None:
        if self._in_phase_us >= self._again_us:
            self._again_us = self._in_phase_us + _AGAIN_US
            self._peer.ask(name, number, *params)
