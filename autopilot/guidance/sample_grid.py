"""The instants at which references are planned: every control sample, whichever the control law previews."""

from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

from colibri.autopilot.control.interface import Horizon, Preview


class Instants(NamedTuple):
    """Instants of the plan, and which of them a control law previews.

    Attributes:
        preview: From now on, a control sample apart: as far as the law looks, and at least to the next sample.
        rows: Those for the law; None if all are.
    """

    preview: Preview
    rows: Sequence[int] | None

    def for_law(self, horizon: Horizon) -> Horizon:
        """Return the references that the law previews."""
        return horizon if self.rows is None else Horizon(*(column[self.rows] for column in horizon))


def instants(preview: Preview, control_interval_us: int) -> Instants:
    """Return the instants for a law with this preview; where it looks between two of them, it sees the later one."""
    rows = [ceil(i * preview.interval_us / control_interval_us) for i in range(preview.samples)]
    samples = max(rows[-1] + 1, 2)
    return Instants(Preview(control_interval_us, samples), None if rows == list(range(samples)) else rows)
