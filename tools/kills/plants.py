"""Plants killed in flight: the autopilot waits, and flies the next one from the start."""

import random
from pathlib import Path
from typing import NamedTuple

from colibri.mavlink.hil.feedback import Feedback
from tools.kills.autopilots import start, start_plant
from tools.kills.between import COMPILES_S, Between, KillInstant
from tools.kills.station import KillStation, mission

_MAX_DELAY_S = 12.0


class PlantKill(NamedTuple):
    """Outcome of a kill."""

    time_s: float
    phase: KillInstant
    said: str  # the autopilot's report; empty if the next plant came first
    stood: bool  # disarmed and without a mission at the next plant's start


def fly(folder: Path, feedback: Feedback, seed: int, kills: int) -> tuple[list[PlantKill], str]:
    folder.mkdir()
    chance = random.Random(seed)
    station = KillStation(mission())
    processes = [start_plant(folder, "udpin:127.0.0.1:0", seed)]
    try:
        url = processes[0].wait_for("listening")["url"]
        _, host, port = url.split(":")
        between = Between((host, int(port)))
        autopilot = start(folder, between.url, station, feedback)
        processes.insert(0, autopilot)

        def kill() -> PlantKill:
            """Kill the plant; start another at once, or after the autopilot's report."""
            plant = processes[-1]
            between.fly_until(station, lambda: station.armed is True, "the rotors to be armed", COMPILES_S)
            phase = chance.choice(list(KillInstant))
            due_us = between.time_us + round(1e6 * chance.uniform(0.0, _MAX_DELAY_S))
            between.at(due_us, phase, plant.process.kill)
            between.fly_until(station, lambda: not between.waits, "the instant of the kill")
            plant.process.wait()
            died_us, silences = between.time_us, len(autopilot.events("silence"))
            if chance.random() < 0.5:
                between.fly_until(
                    station, lambda: len(autopilot.events("silence")) > silences, "the words that the plant is gone"
                )
            said = [event["text"] for event in autopilot.events("silence")[silences:]]
            station.begin_anew()
            station.drain()
            processes.append(start_plant(folder, url, seed))
            between.fly_until(
                station, lambda: station.armed is not None and between.time_us < died_us, "the next plant's flight"
            )
            return PlantKill(died_us * 1e-6, phase, said[0] if said else "", station.armed is False)

        done = [kill() for _ in range(kills)]
        between.fly_until(station, lambda: station.armed is True, "the last plant's vehicle to be armed")
        between.close()
    finally:
        for process in processes:
            process.kill()
        station.close()
    return done, "".join(process.errors() for process in processes)
