"""A client program in a process group of its own: started, listened to, ended with all that it started."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Self

from tools.harness.processes import wait_for

_SECONDS_PER_HOUR = 3600.0
_ROOT = Path(__file__).parents[3]
_SCRIPT_WITHIN_S = 120.0  # a wall-clock bound for what hangs


class Client:
    def __init__(self, command: Sequence[str], folder: Path, environment: Mapping[str, str] | None = None) -> None:
        """Start `command` in `folder`, with more in its environment; what it prints is kept in the folder, too."""
        self.folder = folder
        self._printed = folder / "printed.txt"
        with self._printed.open("wb") as printed:
            self.process = subprocess.Popen(
                command,
                cwd=folder,
                env={**os.environ, "PYTHONUNBUFFERED": "1", **(environment or {})},
                stdin=subprocess.PIPE,
                stdout=printed,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    @property
    def printed(self) -> str:
        return self._printed.read_text(encoding="utf-8", errors="replace")

    def wait_printed(self, pattern: str, within_s: float = 20.0, *, times: int = 1) -> None:
        wait_for(
            lambda: len(re.findall(pattern, self.printed)) >= times or self.process.poll() is not None,
            f"{pattern} in what is printed",
            within_s / _SECONDS_PER_HOUR,
        )
        found = len(re.findall(pattern, self.printed))
        assert found >= times, f"{pattern} was printed {found} times:\n{self.printed[-2000:]}"

    def wait(self, within_s: float) -> None:
        """Wait until it has ended by itself, well; `within_s` is a wall-clock bound for what hangs."""
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(within_s)
        code = self.process.poll()
        assert code == 0, f"{'no end' if code is None else f'exit code {code}'}:\n{self.printed[-2000:]}"

    def end(self) -> None:
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        if self.process.stdin:
            self.process.stdin.close()


def run_script(name: str, url: str, folder: Path) -> None:
    """Run a script of `tests.clients.mavsdk_scripts` to its end."""
    command = [sys.executable, "-m", "tests.clients.mavsdk_scripts", name, url]
    with Client(command, folder, {"PYTHONPATH": str(_ROOT)}) as client:
        client.wait(_SCRIPT_WITHIN_S)
