"""The progress of many flights on a terminal."""

from colibri.campaigns.flights import FlightResult


class FlightBar:
    def __init__(self, title: str, flights: int, *, quiet: bool) -> None:
        from rich.console import Console
        from rich.markup import escape
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

        console = Console(stderr=True)
        texts, numbers = ("{task.fields[rate]}", "{task.fields[lost]}"), (BarColumn(), MofNCompleteColumn())
        columns = ("{task.description}", *numbers, *texts, TimeRemainingColumn())
        hidden = quiet or not console.is_terminal
        self._bar = Progress(*columns, console=console, disable=hidden, speed_estimate_period=300.0)
        self._task = self._bar.add_task(escape(title), total=flights, rate="", lost="", start=False)
        self._flown = self._lost = 0

    def begun(self, kept: int) -> None:
        self._bar.start()
        self._bar.start_task(self._task)
        self._bar.update(self._task, completed=kept)

    def ended(self, flown: FlightResult) -> None:
        self._flown += 1
        self._lost += flown.verdict.is_lost
        elapsed_s = self._bar.tasks[self._task].elapsed or 0.0
        rate = f"{self._flown / elapsed_s:.1f} flights/s" if elapsed_s else ""
        self._bar.update(self._task, advance=1, rate=rate, lost=f"{100.0 * self._lost / self._flown:.1f} % lost")

    def close(self) -> None:
        self._bar.stop()
