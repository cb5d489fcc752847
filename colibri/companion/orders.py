"""The commands of each phase: arm, take off, take setpoints, hold; and which modes so are the companion's own doing."""

from math import isfinite, nan

from colibri.companion.settings import CompanionSettings
from colibri.companion.stacks.stack import TakeOff
from colibri.companion.supervision.phases import Phase
from colibri.companion.vehicle_peer import VehiclePeer
from colibri.mavlink.client.conversation import UNANSWERED
from colibri.mavlink.client.modes import FlightMode
from colibri.mavlink.wire.dialect import RESULT_ACCEPTED, RESULT_TEMPORARILY_REJECTED, mav

_STREAMS_FIRST_US = 1_000_000
"""So long setpoints are streamed before the mode is asked for, as PX4 wants it."""
_HOLD_TRIES = 3
_AGAIN_US = 400_000
_ABOVE_SEA = -1.0
"""A pitch, as QGroundControl sends it with a height above the sea; PX4 passes over it."""
_LEAST_HEIGHT_M = 1.0


class Orders:
    """Gives the commands.

    Attributes:
        refused: What the vehicle has refused, in words; empty for nothing.
        height_enu_m: That a take-off leads to.
    """

    def __init__(self, peer: VehiclePeer, settings: CompanionSettings, track_height_m: float) -> None:
        """Give commands to `peer`; by default it climbs to the height of the track's first point."""
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
        """Whether a command to disarm is on its way, which must not be left there."""
        return self._disarming and "disarm" not in self._peer.results

    @property
    def climbed(self) -> bool:
        """Whether the take-off itself is over: a stack that has a mode for it has left that for hold."""
        stack = self._peer.stack
        return stack is not None and (
            stack.take_off is TakeOff.ARM_THEN_COMMAND or self._peer.report.mode == stack.hold.custom
        )

    @property
    def held(self) -> bool:
        """Whether the vehicle has taken the order to hold, or to land as it cannot hold, and reports that it does."""
        stack = self._peer.stack
        if stack is None:
            return False
        return any(
            self._peer.results.get(f"mode {mode.name}") == RESULT_ACCEPTED and self._peer.report.mode == mode.custom
            for mode in (stack.hold, stack.last_resort)
        )

    def enter(self, phase: Phase, before: Phase) -> None:
        """Begin a phase."""
        stack = self._peer.stack
        if stack is None:
            return
        self._again_us = 0
        self._before, self._reached = self._peer.report.mode, False
        if phase in (Phase.ARMING, Phase.TAKING_OFF):
            self._own = stack.steady | {stack.offboard.custom}
        elif phase in (Phase.TAKING_OVER, Phase.FLYING):
            self._own = frozenset({stack.offboard.custom})
        elif phase is Phase.HANDING_OVER:
            self._peer.clear()
            self._own = frozenset({stack.hold.custom, stack.last_resort.custom})
            if before is Phase.ARMING:
                self._disarming = True
                self._peer.ask("disarm", mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)

    def own_modes(self, phase: Phase) -> frozenset[int]:
        """Return the modes that are no pilot's choice: those asked for, and until one is reported the one before."""
        mode = self._peer.report.mode
        if mode in self._own:
            self._reached = True
        if phase is Phase.FLYING or self._reached:
            return self._own
        return self._own | {self._before}

    def poll(self, phase: Phase, in_phase_us: int, *, ready: bool) -> None:
        """Have sent what a phase needs; `ready`: whether the vehicle may be told to hold."""
        stack, results = self._peer.stack, self._peer.results
        self._in_phase_us = in_phase_us
        if stack is None or self._settings.dry_run:
            return
        if phase is Phase.ARMING:
            self._arm(stack.take_off)
        elif phase is Phase.TAKING_OFF and stack.take_off is TakeOff.ARM_THEN_COMMAND:
            self._once("take-off", mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan, 0.0, 0.0, self._climb_m)
        elif phase is Phase.TAKING_OVER and in_phase_us >= _STREAMS_FIRST_US:
            self._mode(stack.offboard, in_phase_us)
        elif phase is Phase.HANDING_OVER and ready and self._peer.report.armed:
            last_try = self._asked_hold >= _HOLD_TRIES
            wanted = stack.last_resort if last_try else stack.hold
            name = f"mode {wanted.name}"
            if results.get(name) not in (None, RESULT_ACCEPTED):
                self._asked_hold += 1
            self._mode(wanted, in_phase_us)

    def _arm(self, take_off: TakeOff) -> None:
        stack, results = self._peer.stack, self._peer.results
        assert stack is not None, "it is connected"
        if take_off is TakeOff.COMMAND_THEN_ARM:
            above_sea_m = self._peer.report.altitude_amsl_m + self._climb_m
            if not isfinite(above_sea_m):
                return
            first = "take-off"
            self._once(first, mav.MAV_CMD_NAV_TAKEOFF, _ABOVE_SEA, 0.0, 0.0, nan, nan, nan, above_sea_m)
        else:
            first = f"mode {stack.offboard.name}"
            self._once(first, mav.MAV_CMD_DO_SET_MODE, *stack.offboard.command)
        if results.get(first) == RESULT_ACCEPTED:
            self._once("arming", mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def set_ground(self, ground_enu_m: float) -> None:
        """Take in at which height the vehicle stands, ENU, before it is armed."""
        asked_m = self._settings.takeoff_height_m
        climb_m = self._track_height_m - ground_enu_m if asked_m is None else asked_m
        self._climb_m = max(climb_m, _LEAST_HEIGHT_M)
        self.height_enu_m = ground_enu_m + self._climb_m

    def _mode(self, mode: FlightMode, in_phase_us: int) -> None:
        """Order a mode, and again after a while if it was refused, or taken and yet is not reported."""
        name = f"mode {mode.name}"
        taken = self._peer.results.get(name) == RESULT_ACCEPTED and self._peer.report.mode == mode.custom
        if not taken and in_phase_us >= self._again_us:
            self._again_us = in_phase_us + _AGAIN_US
            self._peer.ask(name, mav.MAV_CMD_DO_SET_MODE, *mode.command)

    def _once(self, name: str, number: int, *params: float) -> None:
        """Give a command, and again while it is refused for the time being; else a refusal, or silence, is the end."""
        result = self._peer.results.get(name)
        if result is None:
            self._peer.ask(name, number, *params)
        elif result == RESULT_TEMPORARILY_REJECTED:
            if self._in_phase_us >= self._again_us:
                self._again_us = self._in_phase_us + _AGAIN_US
                self._peer.ask(name, number, *params)
        elif result != RESULT_ACCEPTED:
            said = "; ".join(self._peer.report.texts[-2:])
            how = "was not answered" if result == UNANSWERED else f"was refused (result {result})"
            self.refused = f"{name} {how}" + (f": {said}" if said else "")
