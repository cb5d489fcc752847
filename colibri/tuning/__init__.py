"""Numbers of a profile, tried by Optuna on many flights: which are best, and what that is worth on seeds never seen."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.tuning.results import TuningResults as TuningResults
    from colibri.tuning.run import tune as tune
    from colibri.tuning.space import TuningError as TuningError
else:
    __getattr__, __dir__ = public(__name__)
