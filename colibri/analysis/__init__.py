"""Recordings of a flight: joined, judged, drawn, tabled."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.analysis.figure_series import FigureSeries as FigureSeries
    from colibri.analysis.figures import draw_flight as draw_flight
    from colibri.analysis.logs import RecordingError as RecordingError
    from colibri.analysis.outcome import keep_flight as keep_flight
    from colibri.analysis.outcome import keep_what_there_is as keep_what_there_is
    from colibri.analysis.recording import FlightReader as FlightReader
    from colibri.analysis.recording import Recording as Recording
    from colibri.analysis.recording import read_recording as read_recording
    from colibri.analysis.report import print_report as print_report
    from colibri.analysis.report import write_report as write_report
else:
    __getattr__, __dir__ = public(__name__)
