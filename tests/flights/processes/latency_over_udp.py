"""`python -m tests.flights.processes.latency_over_udp SPEED MS...`: docs/latency.md with a plant that runs freely.

The delay is not compensated. Two processes over UDP beside the wall clock, and a relay between them that delays each
datagram by half of the round trip. What the processes themselves take comes on top, and is measured: the time from a
frame's being due to its answer. At a SPEED below 1 time is slow for the plant, and what else the computer does counts
for less.
"""

import sys
from collections import deque
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from time import perf_counter, sleep

from colibri.analysis.recording import read_recording
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec
from tools.harness.ports import Relay
from tools.harness.processes import Process, running
from tools.pages.latency import LEMNISCATE, STEP, LatencyCase, merit

_LOOK_EVERY_S = 0.0002


class DelayRelay(Relay):
    """Delays datagrams, both ways alike."""

    def __init__(self, plant_url: str, delay_s: float) -> None:
        super().__init__(plant_url)
        self._delay_s = delay_s
        self._late: deque[tuple[float, str, bytes]] = deque()
        Thread(target=self._deliver_late, daemon=True).start()

    def pass_on(self, to: str, datagram: bytes) -> None:
        self._late.append((perf_counter() + self._delay_s, to, datagram))

    def _deliver_late(self) -> None:
        while not self._ended.is_set():
            while self._late and self._late[0][0] <= perf_counter():
                _, to, datagram = self._late.popleft()
                self.deliver(to, datagram)
            sleep(_LOOK_EVERY_S)


def fly(case: LatencyCase, round_trip_ms: float, speed: float) -> tuple[float | None, float]:
    """Fly a case; return how it went, and the mean round trip that the plant has measured, ms."""
    with TemporaryDirectory() as temporary:
        logs, out = Path(temporary) / "logs", Path(temporary) / "flight"
        logs.mkdir()
        options = {"link": "udp", "start": case.start, "duration": case.duration_s, "out": out}
        plan = FlightPlan.of(FlightSpec.of(case.track, **options))
        words = ("--start", str(plan.start), "--duration", repr(case.duration_s), "--speed", repr(speed))
        plant = Process(logs, "plant", "--realtime", "--link", "udpin:127.0.0.1:0", *words, "--out", str(out))
        url = plant.wait_for("listening")["url"].replace("udpin", "udpout")
        with DelayRelay(url, 0.5e-3 * round_trip_ms / speed) as relay:
            to_fly = ("--plant", relay.url, "--track", case.track, "--delay", "0", "--out", str(out))
            autopilot = Process(logs, "autopilot", *to_fly)
            with running(plant, autopilot):
                plant.process.wait()
                ended = plant.events("ended")
        measured_ms = ended[-1]["round_trip_ms"] if ended else float("nan")
        return merit(read_recording(plan), case), measured_ms


def main() -> int:
    speed, *round_trips_ms = map(float, sys.argv[1:])
    for round_trip_ms in round_trips_ms:
        for case in (STEP, LEMNISCATE):
            went, measured_ms = fly(case, round_trip_ms, speed)
            words = "lost" if went is None else f"{went:.3g} m, RMS"
            sys.stdout.write(f"{round_trip_ms:g} ms, measured {measured_ms:.1f} ms, {case.name}: {words}\n")
            sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
