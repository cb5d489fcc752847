"""The guard of a flight: exceptions caught, recorded with what is needed to look into them, said once, counted.

A part that has raised is tried again at its next turn; `table` has all parts, and says which are left out for good.
"""

from collections import Counter
from collections.abc import Callable
from traceback import format_exception
from typing import TypeVar, TypeVarTuple

import msgspec

from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.core.defence.table import PARTS, TRIES
from colibri.common.serialization import to_bytes
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.services.statustext import CRITICAL

T = TypeVar("T")
Ts = TypeVarTuple("Ts")
_MAX_RECORDS = 3
"""Of one part: what raises in every frame would fill the disk."""
_MAX_KEPT = 100


class ErrorRecord(msgspec.Struct, frozen=True, kw_only=True):
    """An exception that was caught.

    Attributes:
        time_us: Simulated time of the frame.
        part: What raised.
        instead: What it is replaced by.
        error: The exception in one line.
        traceback: Whole.
        mode: Flight mode.
        armed: Whether the rotors might turn.
        frame: Of the plant, by `to_bytes`; empty where there was none.
        checkpoint: The flight as it was then, by `to_bytes`; empty where it cannot be recorded.
    """

    time_us: int
    part: str
    instead: str
    error: str
    traceback: str
    mode: str
    armed: bool
    frame: bytes
    checkpoint: bytes


class Defence:
    """Catches the exceptions of one vehicle.

    Attributes:
        frame: The one that is answered; None before the first.
        counts: How often each part has raised.
        off: Parts that raised too often.
    """

    def __init__(self, pilot: Pilot, say: Callable[[int, str], None], *, strict: bool) -> None:
        """Report by `say`; `strict`: raise what is caught."""
        self._pilot, self._say, self._strict = pilot, say, strict
        self._checkpoint: Callable[[], object] | None = None
        self._records: list[ErrorRecord] = []
        self._kept = 0
        self.frame: Frame | None = None
        self.counts: Counter[str] = Counter()
        self.off: set[str] = set()

    def keep(self, checkpoint: Callable[[], object]) -> None:
        """Record with each exception what `checkpoint` returns."""
        self._checkpoint = checkpoint

    def guard(self, part: str, call: Callable[[*Ts], T], otherwise: Callable[[], T], *args: *Ts) -> T:
        """Return what `call` returns; what `otherwise` does where that raises, or the part is left out by now.

        Raises:
            Exception: What `call` raises, if strict.
        """
        if part in self.off and PARTS[part].optional:
            return otherwise()
        try:
            return call(*args)
        except Exception as error:
            self.caught(part, error)
        return otherwise()

    def caught(self, part: str, error: Exception, instead: str = "") -> None:
        """Take in an exception of a part; `instead`, where given, says what replaces it.

        Raises:
            Exception: The same one, if strict.
        """
        if self._strict:
            raise error
        self.counts[part] += 1
        if self.counts[part] >= TRIES:
            self.off.add(part)
        instead = instead or PARTS[part].instead
        if self.counts[part] == 1:
            self._pilot.readiness.fail(f"{part} failed: restart the autopilot")
            self._say(CRITICAL, f"{part} failed: {instead}")
        if self.counts[part] <= _MAX_RECORDS and self._kept < _MAX_KEPT:
            self._kept += 1
            self._records.append(self._record(part, instead, error))

    def take(self) -> list[ErrorRecord]:
        """Return what was recorded since this was last asked."""
        records, self._records = self._records, []
        return records

    def _record(self, part: str, instead: str, error: Exception) -> ErrorRecord:
        frame, state = self.frame, self._pilot.state
        words = " ".join(str(error).split())
        return ErrorRecord(
            time_us=0 if frame is None else frame.time_us,
            part=part,
            instead=instead,
            error=f"{type(error).__name__}: {words}" if words else type(error).__name__,
            traceback="".join(format_exception(error)),
            mode=str(state.mode),
            armed=state.armed,
            frame=_bytes(lambda: frame),
            checkpoint=_bytes(self._checkpoint),
        )


def _bytes(make: Callable[[], object] | None) -> bytes:
    """Return what `make` returns as bytes; none where it raises: it may be what has failed."""
    try:
        made = None if make is None else make()
        return b"" if made is None else to_bytes(made)
    except Exception:  # the part that failed may be the one read here: a record without it beats none
        return b""
