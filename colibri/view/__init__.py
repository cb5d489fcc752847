"""Show flights and live vehicles in a browser."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.view.recorded.flight import RecordedFlight as RecordedFlight
    from colibri.view.snapshot import Chart as Chart
    from colibri.view.snapshot import Snapshot as Snapshot
    from colibri.view.snapshot import Source as Source
    from colibri.view.snapshot import ViewError as ViewError
else:
    __getattr__, __dir__ = public(__name__)
