"""`python -m tools.frames`: the longest frame of each kind of request, in ms of work."""

import argparse
import gc
import random
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import thread_time
from typing import Any

from colibri.common.process.lifecycle import gc_frozen, use_one_thread
from colibri.mavlink.files.folder import Folder
from tools.frames.requests import REQUESTS, in_the_air
from tools.fuzz.flight import BareFlight
from tools.fuzz.messages import Messages
from tools.fuzz.sensible import COMMANDS

FRAMES_AFTER = 60
MOST_BYTES = 4096
"""What a link receives at once."""
FILES = 999


class Timed:
    """Times the work of an autopilot at each frame: its answer, and what it does for ground stations."""

    def __init__(self, flight: BareFlight) -> None:
        self.flight = flight
        self.worst_s = self.total_s = 0.0
        self._frame_s = 0.0
        autopilot: Any = flight.autopilot
        autopilot.step, autopilot.serve = self._timed(autopilot.step), self._timed(autopilot.serve)

    def _timed(self, work: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*args: Any) -> Any:
            began_s = thread_time()
            outcome = work(*args)
            self._frame_s += thread_time() - began_s
            return outcome

        return timed

    def send(self, messages: list[bytes]) -> None:
        datagram = b"".join(messages)
        while len(datagram) > MOST_BYTES:
            messages.pop()
            datagram = b"".join(messages)
        if datagram:
            self.flight.client.send_raw(datagram)
        self._frame_s = 0.0
        self.flight.step()
        self.worst_s = max(self.worst_s, self._frame_s)
        self.total_s += self._frame_s


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.frames", description=__doc__)
    parser.add_argument("only", nargs="*", help="parts of names of requests")
    parser.add_argument("--random", type=int, default=10_000, help="random messages, 40 a frame")
    parser.add_argument("--repeat", type=int, default=2, help="of which the quickest counts")
    args = parser.parse_args()
    use_one_thread()
    sys.stdout.write(f"{'request':45} {'worst frame':>11} {'in all':>9}   ms of work\n")
    worst = 0.0
    for name in REQUESTS:
        if not args.only or any(part in name for part in args.only):
            times = min(_times(name) for _ in range(args.repeat))
            worst = max(worst, times[0])
            _print(name, *times)
    if args.random and not args.only:
        times = _random(args.random)
        _print(f"{args.random} random messages", *times)
        worst = max(worst, times[0])
    _print("worst", worst, 0.0)
    return 0


def _print(name: str, worst_ms: float, total_ms: float) -> None:
    sys.stdout.write(f"{name:45} {worst_ms:11.2f} {total_ms:9.1f}\n")
    sys.stdout.flush()


def _times(name: str) -> tuple[float, float]:
    with TemporaryDirectory() as folder:
        files = _files(Path(folder))
        flight = BareFlight(files=files)
        in_the_air(flight)
        flight.run(0.3)
        timed = Timed(flight)
        gc.collect()
        gc.disable()
        for messages in REQUESTS[name](flight):
            timed.send(list(messages))
        for _ in range(FRAMES_AFTER):
            timed.send([])
        gc.enable()
        files.close()
    return timed.worst_s * 1e3, timed.total_s * 1e3


def _random(count: int) -> tuple[float, float]:
    with TemporaryDirectory() as folder:
        files = _files(Path(folder))
        flight = BareFlight(files=files)
        in_the_air(flight)
        timed = Timed(flight)
        names = [parameter.name for parameter in flight.copter.parameters]
        messages = Messages(random.Random(1), names, COMMANDS)
        with gc_frozen():  # as processes fly
            for _ in range(count // 40):
                timed.send([messages.any().frame for _ in range(40)])
        files.close()
    return timed.worst_s * 1e3, timed.total_s * 1e3


def _files(folder: Path) -> Folder:
    for name in ("file", "logs/log"):
        (folder / name).parent.mkdir(exist_ok=True)
        for number in range(FILES):
            (folder / f"{name}{number:04}").touch()
    (folder / "big").write_bytes(bytes(8 << 20))
    return Folder(folder)


if __name__ == "__main__":
    sys.exit(main())
