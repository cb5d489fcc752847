"""`python -m tools.frames`: the longest frame of each request, in ms of work."""

import argparse
import random
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing
from pathlib import Path
from tempfile import TemporaryDirectory

from colibri.common.process.lifecycle import gc_frozen, use_one_thread
from colibri.mavlink.files.folder import Folder
from tools.frames.requests import REQUESTS, Request, in_the_air
from tools.fuzz.messages import COMMANDS, Messages
from tools.fuzz.vehicle import BareFlight
from tools.harness.frame_times import FrameTimes, gc_off

FRAMES_AFTER = 60
MOST_BYTES = 4096
"""What a link receives at once."""
FILES = 999


class Timed:
    def __init__(self, flight: BareFlight) -> None:
        self.flight = flight
        self._frames_s = FrameTimes(flight.autopilot)

    @property
    def times(self) -> tuple[float, float]:
        """The longest frame and all frames, ms of work."""
        return 1e3 * max(self._frames_s), 1e3 * sum(self._frames_s)

    def send(self, messages: list[bytes]) -> None:
        while sum(map(len, messages)) > MOST_BYTES:
            messages.pop()
        if messages:
            self.flight.client.send_raw(b"".join(messages))
        self.flight.step()


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.frames", description=__doc__)
    parser.add_argument("only", nargs="*", help="parts of names of requests")
    parser.add_argument("--random", type=int, default=10_000, help="random messages, 40 a frame")
    parser.add_argument("--repeat", type=int, default=2, help="of which the quickest counts")
    args = parser.parse_args()
    use_one_thread()
    print(f"{'request':45} {'worst frame':>11} {'in all':>9}   ms of work")
    worst = 0.0
    for name, request in REQUESTS.items():
        if not args.only or any(part in name for part in args.only):
            times = min(_times(request, gc_off, FRAMES_AFTER) for _ in range(args.repeat))
            worst = max(worst, times[0])
            _print(name, *times)
    if args.random and not args.only:
        times = _times(_random(args.random), gc_frozen)  # as processes fly
        _print(f"{args.random} random messages", *times)
        worst = max(worst, times[0])
    _print("worst", worst, 0.0)
    return 0


def _print(name: str, worst_ms: float, total_ms: float) -> None:
    print(f"{name:45} {worst_ms:11.2f} {total_ms:9.1f}", flush=True)


def _times(
    request: Request, garbage: Callable[[], AbstractContextManager[None]], frames_after: int = 0
) -> tuple[float, float]:
    with TemporaryDirectory() as folder, closing(_files(Path(folder))) as files:
        flight = BareFlight(files=files)
        in_the_air(flight)
        flight.run(0.3)
        timed = Timed(flight)
        with garbage():
            for messages in request(flight):
                timed.send(list(messages))
            for _ in range(frames_after):
                timed.send([])
    return timed.times


def _random(count: int) -> Request:
    def request(flight: BareFlight) -> Iterator[list[bytes]]:
        names = [parameter.name for parameter in flight.copter.parameters]
        messages = Messages(random.Random(1), names, COMMANDS)
        for _ in range(count // 40):
            yield [messages.any().frame for _ in range(40)]

    return request


def _files(folder: Path) -> Folder:
    for name in ("file", "logs/log"):
        (folder / name).parent.mkdir(exist_ok=True)
        for number in range(FILES):
            (folder / f"{name}{number:04}").touch()
    (folder / "big").write_bytes(bytes(8 << 20))
    return Folder(folder)


if __name__ == "__main__":
    sys.exit(main())
