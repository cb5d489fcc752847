"""The flight mode that clients see, and the vehicle's mode that flies it."""

from collections.abc import Callable

from colibri.autopilot.commander.needs import ModeNeeds
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.failsafe_table import Action
from colibri.autopilot.commander.rules.modes import MANUAL, Mode, State, first_missing
from colibri.autopilot.commander.rules.shown_modes import ModeBook, ShownMode
from colibri.mavlink.wire.dialect import Refusal

THROTTLE_UP = 0.1  # of the stick's way; it starts a mission that waits


class ModeSelection:
    """Selects modes by an identity's numbers, and follows the pilot's changes.

    Attributes:
        enters: By number, how modes begin that the vehicle does not have.
        starts_armed: Whether a mode that waits starts without throttle.
        base_modes: Of HEARTBEAT without the armed bit: without sticks, and with them.
    """

    def __init__(self, book: ModeBook, pilot: Pilot, needs: ModeNeeds) -> None:
        self.book, self._pilot, self._needs = book, pilot, needs
        self._numbers = book.numbers
        self.shown = self._numbers[book.first]
        self.enters: dict[int, Callable[[], Refusal | None]] = {}
        self.starts_armed: Callable[[], bool] = lambda: False
        self._waits = self._armed = False
        self._state: State | None = None
        self._saving = Action.NONE
        self.update()

    def update(self) -> None:
        """Take in the pilot's state, at each control sample."""
        pilot = self._pilot
        if pilot.state is not self._state or pilot.saving is not self._saving:
            self._follow(pilot)
        if self._waits:
            sticks = pilot.sensed.steered.sticks
            raised = sticks is not None and sticks.thrust > THROTTLE_UP
            if pilot.state.armed and (raised or self.starts_armed()):
                self.start()

    def _follow(self, pilot: Pilot) -> None:
        self._state, self._saving = pilot.state, pilot.saving
        mode, armed = pilot.state
        begins, self._armed = armed and not self._armed, armed
        if begins:
            self._show(self._numbers[self.book.resumed[mode]])
        elif pilot.saving >= Action.HOLD:
            self._show(self._numbers[self.book.saved[mode]])
        elif mode not in self.shown.covers:
            self._show(self._numbers[self.book.chosen[mode]])
        elif armed and mode is Mode.HOLD and self.shown.flies in MANUAL and self.shown.flies is not None:
            pilot.select(self.shown.flies, self._needs.missing())  # after a take-off
            self._state = pilot.state
        self.base_modes = self.book.base_modes(self.shown, pilot.state, pilot.ground.times.flights)

    def _show(self, mode: ShownMode) -> None:
        self.shown, self._waits = mode, False

    def select(self, number: int, said: str = "") -> Refusal | None:
        """Select a mode by its number; `said` is how the client wrote it."""
        mode = self._numbers.get(number)
        if mode is None:
            return self.book.unknown(said or str(number))
        refusal = Refusal("not flown by Colibri") if mode.flies is None else self._enter(mode, mode.flies)
        if refusal is not None:
            return self.book.refusal(mode, refusal)
        self.shown, self._state = mode, None
        self.update()
        return None

    def fly(self, mode: Mode) -> Refusal | None:
        refusal = self._pilot.select(mode, self._needs.missing())
        remark = "" if refusal else self._needs.remark(mode)
        if remark:
            self._pilot.warn(remark)
        return refusal

    def _enter(self, mode: ShownMode, flies: Mode) -> Refusal | None:
        pilot = self._pilot
        waits = mode.waits and pilot.ground.standing
        if waits and pilot.state.armed:
            missing = self._needs.missing()
            need = first_missing(flies, missing)
            if need is not None:
                return Refusal(f"{flies} refused: {missing[need]}")
        enter = self.enters.get(mode.number)
        if enter is not None and pilot.state.armed:
            refusal = enter()
        else:
            refusal = self.fly(Mode.HOLD if waits or enter is not None else flies)
        if refusal is None:
            self._waits = waits
        return refusal

    def start(self) -> Refusal | None:
        """Start the mode that waits, or go on with the selected one."""
        self._waits = False
        return None if self.shown.flies is None else self.fly(self.shown.flies)

    def arm(self, *, force: bool) -> Refusal | None:
        self.update()
        shown, pilot = self.shown, self._pilot
        if not shown.to_arm and not pilot.state.armed:
            return self.book.unarmable(shown)
        if shown.flies is not None and pilot.state.mode is not shown.flies and not pilot.state.armed:
            self._enter(shown, shown.flies)
        refusal = pilot.arm(self._needs.missing(), force=force)
        self._armed = pilot.state.armed
        return refusal
