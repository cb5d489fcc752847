"""References of one control sample, and the instants that are planned: every control sample."""

from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

from colibri.autopilot.control.interface import AttitudeDemand, Horizon, Pace, Preview
from colibri.common.records import Record


class Guidance(Record, frozen=True):
    """References for the control law, reset if it `begins`; empty on the ground."""

    horizon: Horizon | None = None
    attitude: AttitudeDemand | None = None
    begins: bool = False
    pace: Pace = Pace.CLOCK


RESTS = Guidance()


class Instants(NamedTuple):
    """Planned instants, and the control law's `rows` (None for all)."""

    preview: Preview
    rows: Sequence[int] | None

    def for_law(self, horizon: Horizon) -> Horizon:
        return horizon if self.rows is None else Horizon(*(column[self.rows] for column in horizon))


def instants(preview: Preview, control_interval_us: int) -> Instants:
    """Return the instants; between two, the later is used."""
    rows = [ceil(i * preview.interval_us / control_interval_us) for i in range(preview.samples)]
    samples = max(rows[-1] + 1, 2)
    return Instants(Preview(control_interval_us, samples), None if rows == list(range(samples)) else rows)
