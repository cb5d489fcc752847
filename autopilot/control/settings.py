"""Settings shared by control laws: the QP solver and the control interval."""

from typing import Annotated, TypeAlias

import msgspec

from colibri.autopilot.control.qp import QpSolver
from colibri.common.config import Positive, SettingsError, Table

ControlInterval: TypeAlias = Annotated[float, msgspec.Meta(ge=0.001, le=1.0)]


class QpSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The QP solver, by its name in qpsolvers."""

    solver: str
    tolerance: Positive
    max_iterations: Annotated[int, msgspec.Meta(ge=1, le=100_000)] = 100_000
    """More count as a time-out."""

    def build(self) -> QpSolver:
        return QpSolver(self.solver, self.tolerance, self.max_iterations)


def interval_us(interval_s: float) -> int:
    """Return an interval in µs; SettingsError unless whole milliseconds, as in MAVLink."""
    if not (interval_s * 1000.0).is_integer():
        raise SettingsError(f"control_interval_s: must be whole milliseconds, not {interval_s}")
    return round(interval_s * 1e6)
