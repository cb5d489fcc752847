"""What a flight left behind, joined, judged, drawn, tabled."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.analysis.figures import draw_flight
    from colibri.analysis.outcome import keep_flight, keep_what_there_is
    from colibri.analysis.recording import Recording, RecordingError, read_recording, write_recording
    from colibri.analysis.report import print_report, write_report
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "colibri.analysis.figures": "draw_flight",
            "colibri.analysis.outcome": "keep_flight keep_what_there_is",
            "colibri.analysis.recording": "Recording RecordingError read_recording write_recording",
            "colibri.analysis.report": "print_report write_report",
        },
    )

__all__ = [
    "Recording",
    "RecordingError",
    "draw_flight",
    "keep_flight",
    "keep_what_there_is",
    "print_report",
    "read_recording",
    "write_recording",
    "write_report",
]
