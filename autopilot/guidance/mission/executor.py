"""The mission executor, with states of MISSION_STATE (https://mavlink.io/en/messages/common.html#MISSION_STATE).

Autocontinue is ignored, as in ArduPilot, because DroneKit recommends 0 for it.
"""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

from colibri.autopilot.guidance.mission.items import DO_AUX_FUNCTION, FENCE_SWITCH, jump_tags, place_of
from colibri.autopilot.guidance.mission.legs import Defaults, ItemContext, LegPhase, MissionContext, phases_of
from colibri.autopilot.guidance.tasks.orders import Hold, Order, OrderRecord, order_of, record_of
from colibri.common.records import Record
from colibri.common.types import Vector
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.mission.service import MissionProgress
from colibri.mavlink.services.command import FAILED
from colibri.mavlink.wire.dialect import Refusal, mav

NO_MISSION: int = mav.MISSION_STATE_NO_MISSION
NOT_STARTED: int = mav.MISSION_STATE_NOT_STARTED
ACTIVE: int = mav.MISSION_STATE_ACTIVE
PAUSED: int = mav.MISSION_STATE_PAUSED
COMPLETE: int = mav.MISSION_STATE_COMPLETE

MAX_ITEMS_A_STEP = 16  # most items started in a step
REST_US = 1_000_000  # delay between jumps without flight between them
CIRCLING_AFTER = 3  # jumps without flight between them
_JUMPS = (mav.MAV_CMD_DO_JUMP, mav.MAV_CMD_DO_JUMP_TAG)
_HOLD = Hold()
_DEFAULTS = Defaults()
_FLYING, _SUSPENDED = 1, 2


class Reached(NamedTuple):
    seq: int


class SetHome(NamedTuple):
    """The mission sets home; None: here."""

    position_enu_m: Vector | None


class Circling(NamedTuple):
    """Jumps lead in a circle, with nothing flown between; the vehicle holds."""

    seq: int


class AuxFunction(NamedTuple):
    """A function of ArduPilot's RCn_OPTION; level 0 is low, 1 middle, 2 high."""

    function: int
    level: int


MissionEvent: TypeAlias = Reached | SetHome | Circling | AuxFunction


class MissionStep(NamedTuple):
    """Output of a step; `flying` is false once complete, paused or cleared."""

    order: Order
    events: tuple[MissionEvent, ...]
    flying: bool


class MissionRecord(Record, frozen=True):
    """Progress of a mission for a restart; context, defaults and order before are of the start of the item."""

    seq: int
    state: int
    order: OrderRecord
    speed_m_s: float | None
    jumps: dict[int, int]  # remaining jumps, by item
    mission_context: MissionContext | None
    defaults: Defaults
    order_before: OrderRecord
    phases: int  # remaining phases of the item
    since_us: int
    fresh: bool  # whether the phase began in the last step
    jumped: int  # jumps since the last flight
    rest_until_us: int


class MissionExecutor:
    """Executor of one plan; `progress` is replaced on every change."""

    def __init__(self, items: Sequence[MissionItem] = (), defaults: Defaults = _DEFAULTS) -> None:
        self.defaults = defaults
        self.items: tuple[MissionItem, ...] = ()
        self.tags: dict[float, int] = {}
        self.progress = MissionProgress()
        self._order: Order = _HOLD
        self._speed_m_s: float | None = None
        self._jumps: dict[int, int] = {}
        self._phases: list[LegPhase] | None = None
        self._context: ItemContext | None = None
        self._since_us = 0
        self._fresh = True
        self._jumped = 0
        self._chosen = False  # the item of a complete mission, by a command
        self._rest_until_us = 0
        self.load(items)

    @property
    def active(self) -> bool:
        return self.progress.state == ACTIVE

    def load(self, items: Sequence[MissionItem]) -> None:
        """Replace the plan; an active mission restarts."""
        flying = self.active
        self.items, self.tags = tuple(items), jump_tags(items)
        self._reset()
        self._show(0, NO_MISSION if not items else ACTIVE if flying else NOT_STARTED)

    def start(self) -> Refusal | None:
        if not self.items:
            return Refusal("no mission")
        if self.progress.state == COMPLETE:
            seq = self.progress.seq if self._chosen else 0
            self._reset()
            self._show(seq, ACTIVE)
        elif not self.active:
            self._leave()
            self._order = _HOLD
            self._show(self.progress.seq, ACTIVE)
        return None

    def pause(self, *, item_flown: bool = False) -> tuple[MissionEvent, ...]:
        """Pause at the current item, or after a return that mode return flies."""
        if not self.active:
            return ()
        seq = self.progress.seq
        self._leave()
        if not item_flown or self.items[seq].command != mav.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            self._show(seq, PAUSED)
            return ()
        self._advance()
        if self.active:
            self._show(self.progress.seq, PAUSED)
        return (Reached(seq),)

    def set_current(self, seq: int, reset: bool = False) -> Refusal | None:
        """Go to an item, -1 for the current one; `reset` resets the jumps, and pauses a complete mission."""
        if not self.items:
            return Refusal(f"item {seq} refused: there is no mission", FAILED)
        seq = self.progress.seq if seq == -1 else seq
        if not 0 <= seq < len(self.items):
            return Refusal(f"mission: item {seq} is not within 0 to {len(self.items) - 1}", FAILED)
        if reset:
            self._jumps.clear()
        self._leave()
        state = self.progress.state
        self._chosen = state == COMPLETE and not reset
        self._show(seq, PAUSED if reset and state == COMPLETE else state)
        return None

    def step(self, mission_context: MissionContext, now_us: int) -> MissionStep:
        events: list[MissionEvent] = []
        for _ in range(MAX_ITEMS_A_STEP):
            if not self.active or now_us < self._rest_until_us or not self._fly(mission_context, now_us, events):
                break
        if not self.active and self.progress.state != COMPLETE:
            self._order = _HOLD
        return MissionStep(self._order, tuple(events), self.active)

    def record(self) -> MissionRecord:
        context = self._context if self._phases else None
        return MissionRecord(
            self.progress.seq,
            self.progress.state,
            record_of(self._order),
            self._speed_m_s,
            self._jumps,
            context.mission_context if context else None,
            context.defaults if context else self.defaults,
            record_of(context.order if context else self._order),
            len(self._phases or ()),
            self._since_us,
            self._fresh,
            self._jumped,
            self._rest_until_us,
        )

    def resume(self, record: MissionRecord) -> None:
        if not 0 <= record.seq < len(self.items):
            return
        self._order, self._speed_m_s, self._jumps = order_of(record.order), record.speed_m_s, dict(record.jumps)
        self._leave()
        self._show(record.seq, record.state)
        self._jumped, self._rest_until_us = record.jumped, record.rest_until_us
        if record.mission_context is None:
            return
        order = order_of(record.order_before)
        self._context = ItemContext(record.mission_context, record.defaults, order, record.speed_m_s)
        phases = list(phases_of(self.items[record.seq], self._context))
        self._phases = phases[max(len(phases) - record.phases, 0) :]
        self._since_us, self._fresh = record.since_us, record.fresh

    def _fly(self, mission_context: MissionContext, now_us: int, events: list[MissionEvent]) -> bool:
        seq = self.progress.seq
        item = self.items[seq]
        if self._phases is None:
            self._context = ItemContext(mission_context, self.defaults, self._order, self._speed_m_s)
            self._phases = list(phases_of(item, self._context))
            if not self._phases:
                self._do(item, mission_context, now_us, events)
                return True
            self._begin(now_us)
        while self._phases:
            phase = self._phases[0]
            seen = mission_context._replace(arrived=False, turns=0.0) if self._fresh else mission_context
            if not phase.ends(seen, (now_us - self._since_us) * 1e-6):
                self._fresh, self._jumped = False, 0
                return False
            if phase.reaches:
                events.append(Reached(seq))
            self._phases.pop(0)
            self._begin(now_us)
        self._advance()
        return True

    def _begin(self, now_us: int) -> None:
        self._since_us = now_us
        if self._phases and self._phases[0].order is not None:
            self._order = self._phases[0].order
        self._fresh = True

    def _do(self, item: MissionItem, mission_context: MissionContext, now_us: int, events: list[MissionEvent]) -> None:
        events.append(Reached(self.progress.seq))
        if item.command == mav.MAV_CMD_DO_CHANGE_SPEED and item.p1 not in (2.0, 3.0):
            if item.p2 > 0.0:
                self._speed_m_s = item.p2
            elif item.p2 == -2.0:
                self._speed_m_s = None
        elif item.command == mav.MAV_CMD_DO_SET_HOME:
            here = item.p1 == 1.0
            events.append(SetHome(None if here else place_of(item, mission_context.home_enu_m, mission_context.origin)))
        elif item.command == DO_AUX_FUNCTION:
            events.append(AuxFunction(int(item.p1), int(item.p2)))
        elif item.command == mav.MAV_CMD_DO_FENCE_ENABLE:
            events.append(AuxFunction(FENCE_SWITCH, 2 if item.p1 == 1.0 else 0))
        elif item.command in _JUMPS and self._jump(item, now_us, events):
            return
        self._advance()

    def _jump(self, item: MissionItem, now_us: int, events: list[MissionEvent]) -> bool:
        seq = self.progress.seq
        left = self._jumps.get(seq, int(item.p2))
        if left == 0:
            return False
        self._jumps[seq] = max(left - 1, -1)
        self._leave()
        self._show(self.tags[item.p1] if item.command == mav.MAV_CMD_DO_JUMP_TAG else int(item.p1), ACTIVE)
        if self._jumped:
            self._rest_until_us = now_us + REST_US
        self._jumped += 1
        if self._jumped == CIRCLING_AFTER:
            events.append(Circling(seq))
        return True

    def _advance(self) -> None:
        self._leave()
        seq = self.progress.seq + 1
        if seq < len(self.items):
            self._show(seq, ACTIVE)
        else:
            self._show(len(self.items) - 1, COMPLETE)

    def _leave(self) -> None:
        self._phases = None
        self._rest_until_us = 0

    def _reset(self) -> None:
        self._leave()
        self._jumps.clear()
        self._jumped, self._chosen = 0, False
        self._speed_m_s = None
        self._order = _HOLD

    def _show(self, seq: int, state: int) -> None:
        self.progress = MissionProgress(seq, state, _FLYING if state == ACTIVE else _SUSPENDED)
