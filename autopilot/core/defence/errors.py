"""The guard of a flight: catches, records, reports and counts exceptions."""

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
_MAX_RECORDS = 3  # of one part: what raises in every frame would fill the disk
_MAX_KEPT = 100


class ErrorRecord(msgspec.Struct, frozen=True, kw_only=True):
    """A caught exception; frame and checkpoint by `to_bytes`."""

    time_us: int  # simulated time of the frame
    part: str
    instead: str  # replacement of the part
    error: str  # in one line
    traceback: str
    mode: str
    armed: bool
    frame: bytes  # empty without one
    checkpoint: bytes  # empty if it cannot be recorded


class Defence:
    def __init__(self, pilot: Pilot, say: Callable[[int, str], None], *, strict: bool) -> None:
        self._pilot, self._say, self._strict = pilot, say, strict
        self._checkpoint: Callable[[], object] | None = None
        self._records: list[ErrorRecord] = []
        self._kept = 0
        self.frame: Frame | None = None  # the present one
        self.counts: Counter[str] = Counter()  # exceptions by part
        self.off: set[str] = set()  # parts that are switched off

    def keep(self, checkpoint: Callable[[], object]) -> None:
        """Record `checkpoint` with each exception."""
        self._checkpoint = checkpoint

    def guard(self, part: str, call: Callable[[*Ts], T], otherwise: Callable[[], T], *args: *Ts) -> T:
        """Return the result of `call`, or of `otherwise` if the part is off or raises, unless strict."""
        if part in self.off and PARTS[part].optional:
            return otherwise()
        try:
            return call(*args)
        except Exception as error:
            self.caught(part, error)
        return otherwise()

    def caught(self, part: str, error: Exception, instead: str = "") -> None:
        """Record an exception, or raise it if strict; `instead` overrides the name of the replacement."""
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
        """Return the records since the last call."""
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
    try:
        made = None if make is None else make()
        return b"" if made is None else to_bytes(made)
    except Exception:  # the part that failed may be the one read here: a record without it beats none
        return b""
