"""`colibri sitl` for tests: started on free ports, observed, ended."""

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tools.harness.observer import Observer
from tools.harness.processes import wait_for

WAITING = "udpin:127.0.0.1:0"
_WAITS = re.compile(r"waits for ground stations on 127\.0\.0\.1:(\d+) \((udpin|tcpin)\)")
_GRACE_S = 10.0
_COMPILES_HOURS = 0.05
"""The first start after a change compiles."""


class SitlProcess:
    def __init__(
        self, process: subprocess.Popen[bytes], seen: Observer, state: Path, said: Path, printed: Path
    ) -> None:
        self.process = process
        self.seen = seen
        self.state = state
        self._said, self._printed = said, printed

    @property
    def ports(self) -> list[int]:
        return [int(port) for port, _ in _WAITS.findall(self.said)]

    @property
    def port(self) -> int:
        return self.ports[0]

    @property
    def mavsdk_url(self) -> str:
        return f"udpout://127.0.0.1:{self.port}"

    @property
    def said(self) -> str:
        return self._said.read_text(encoding="utf-8")

    @property
    def printed(self) -> list[str]:
        return self._printed.read_text(encoding="utf-8").splitlines()

    def end(self) -> int:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise


@contextmanager
def vehicle(
    folder: Path, *options: str, links: tuple[str, ...] = (WAITING,), speed: float = 1.0
) -> Iterator[SitlProcess]:
    """Run `colibri sitl` within a block, ready to be armed, with its files in `folder`."""
    said, printed, state = folder / "sitl.err", folder / "sitl.out", folder / "state"
    with Observer() as seen, said.open("wb") as errors, printed.open("wb") as output:
        command = [
            *(sys.executable, "-m", "colibri", "sitl", "--plant-port", "0", "--speed", repr(speed)),
            *("--state", str(state)),
            *(f"--gcs={url}" for url in (*links, seen.url)),
            *options,
        ]
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=errors)
        flown = SitlProcess(process, seen, state, said, printed)
        try:
            wait_for(lambda: seen.sights or process.poll() is not None, "the vehicle's first word", _COMPILES_HOURS)
            assert process.poll() is None, flown.said
            yield flown
        finally:
            flown.end()
