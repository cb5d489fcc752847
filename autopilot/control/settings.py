"""Settings shared by control laws: the QP solver and the control interval."""

from functools import cache
from typing import Annotated, TypeAlias
from warnings import warn

import msgspec

from colibri.autopilot.control.law_files import full_name, is_place
from colibri.autopilot.control.qp import QpSolver
from colibri.common.config import Positive, SettingsError, Table

ControlInterval: TypeAlias = Annotated[float, msgspec.Meta(ge=0.001, le=1.0)]


class QpSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The QP solver, by its name in qpsolvers."""

    solver: str
    tolerance: Positive
    max_iterations: Annotated[int, msgspec.Meta(ge=1, le=100_000)] = 100_000
    """Beyond it, the status is time-out."""

    def build(self) -> QpSolver:
        return QpSolver(self.solver, self.tolerance, self.max_iterations)


RENAMED = {"whole-lpv-mpc": "lpv-mpc"}  # names of 0.1, accepted until 0.3


def current_name(name: str) -> str:
    """Return the present name of a control law; of a file, with the name of its law."""
    return full_name(name) if is_place(name) else present_name(name)


@cache
def present_name(name: str) -> str:
    """Return the name of a law, with a warning if it was renamed."""
    if name in RENAMED:
        warn(f'controller "{name}" is now called "{RENAMED[name]}"', FutureWarning, stacklevel=3)
    return RENAMED.get(name, name)


def interval_us(interval_s: float) -> int:
    """Return an interval in µs; SettingsError unless whole milliseconds, as in MAVLink."""
    if not (interval_s * 1000.0).is_integer():
        raise SettingsError(f"control_interval_s: must be whole milliseconds, not {interval_s}")
    return round(interval_s * 1e6)
