"""Tune numbers of a profile with Optuna, and test the result with other seeds."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.tuning.definition import TuningError as TuningError
    from colibri.tuning.results import TuningResults as TuningResults
    from colibri.tuning.run import tune as tune
else:
    __getattr__, __dir__ = public(__name__)
