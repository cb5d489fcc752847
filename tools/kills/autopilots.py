"""Autopilots killed in flight, each kill judged."""

import random
from pathlib import Path
from time import sleep
from typing import NamedTuple

import numpy as np

from colibri.common.types import Array
from colibri.mavlink.hil.feedback import Feedback
from colibri.sitl.flight_record import tilt_deg
from tools.harness.processes import Process, topic_rows
from tools.kills.between import COMPILES_S, Between, KillInstant
from tools.kills.station import HOVERS, LEGS, KillStation, mission

_APART_S, _SPREAD_S = 1.8, 1.6
_JUDGED_S = 2.0
_SLOW_M_S = 0.3
_COMPUTES_S = 1.5e-3
STANDING = "y=0,z=0,psi=90,rotors=0"


class AutopilotKill(NamedTuple):
    """Outcome of a kill."""

    time_s: float  # of the frame, simulated
    phase: KillInstant
    item: int  # of the mission, current
    hovered: bool  # at the kill
    still: bool  # in the same item at the next kill
    tilt_deg: float  # largest before the next kill
    tilt_before_deg: float  # largest in the second before
    lost_m: float  # height lost within two seconds, if still
    moved_m: float  # then, if still
    went_on: bool  # reported by the autopilot


class KilledMission(NamedTuple):
    """Outcome of a mission."""

    kills: list[AutopilotKill]
    flown: bool
    duration_s: float
    words: str


def fly(folder: Path, feedback: Feedback, seed: int, max_kills: int, legs: int = LEGS) -> KilledMission:
    folder.mkdir()
    station = KillStation(mission(legs))
    plant = start_plant(folder, "udpin:127.0.0.1:0", seed, out=folder)
    processes = [plant]
    try:
        _, host, port = plant.wait_for("listening")["url"].split(":")
        between = Between((host, int(port)))
        killer = _Killer(folder, between, station, feedback, random.Random(seed))
        processes = killer.processes
        processes.append(plant)
        killer.begin()
        while len(killer.kills) < max_kills and killer.kill():
            pass
        between.fly_until(station, lambda: station.flown, "the end of the mission")
        between.close()
    finally:
        for process in processes:
            process.kill()
        station.close()
    words = "".join(process.errors() for process in processes)
    truth = topic_rows(folder)
    return KilledMission(judged(truth, killer.kills), station.flown, float(truth["t"][-1]), words)


def start(folder: Path, url: str, station: KillStation, feedback: Feedback) -> Process:
    options = ("--plant", url, "--gcs", station.url, "--feedback", feedback, "--state", str(folder / "state"))
    return Process(folder, "autopilot", *options)


def start_plant(folder: Path, url: str, seed: int, out: Path | None = None) -> Process:
    kept = () if out is None else ("--out", str(out))
    return Process(folder, "plant", "--start", STANDING, "--seed", str(seed), "--link", url, *kept)


class _Killed(NamedTuple):
    time_s: float
    phase: KillInstant
    item: int
    went_on: bool


class _Killer:
    def __init__(self, folder: Path, between: Between, station: KillStation, feedback: Feedback, chance: random.Random):
        self._folder, self._between, self._station = folder, between, station
        self._feedback, self._chance = feedback, chance
        self._phase, self._died_us = KillInstant.BEFORE, 0
        self.kills: list[_Killed] = []
        self.processes: list[Process] = []

    def begin(self) -> None:
        self._start()
        station = self._station
        self._between.fly_until(station, lambda: station.armed is True, "the rotors to be armed", COMPILES_S)
        self._died_us = self._between.time_us - round(_APART_S * 1e6)

    def kill(self) -> bool:
        """Return False if the mission ends before the kill."""
        between, station, chance = self._between, self._station, self._chance
        self._phase = chance.choice(list(KillInstant))
        due_us = self._died_us + round(1e6 * (_APART_S + chance.uniform(0.0, _SPREAD_S)))
        between.at(due_us, self._phase, self._strike)
        between.fly_until(station, lambda: station.flown or not between.waits, "the instant of the kill")
        if station.flown:
            return False
        self.processes[-1].process.wait()
        self._died_us, item = between.time_us, station.seq
        station.texts.clear()
        between.cut()
        self._start()
        between.fly_until(station, lambda: between.time_us > self._died_us, "the flight to go on")
        between.fly_until(station, lambda: station.flown or self._is_said, "the words that it goes on")
        self.kills.append(_Killed(self._died_us * 1e-6, self._phase, item, self._is_said))
        return True

    def _start(self) -> None:
        self.processes.append(start(self._folder, self._between.url, self._station, self._feedback))

    def _strike(self) -> None:
        if self._phase is KillInstant.DURING:
            sleep(self._chance.uniform(0.0, _COMPUTES_S))
        self.processes[-1].process.kill()

    @property
    def _is_said(self) -> bool:
        return any("Restarted in flight" in text for text in self._station.texts)


def judged(truth: dict[str, Array], kills: list[_Killed]) -> list[AutopilotKill]:
    t, place = truth["t"], np.stack([truth[axis] for axis in "xyz"], axis=1)
    tilt = tilt_deg(truth)
    speed = np.sqrt(truth["u"] ** 2 + truth["v"] ** 2 + truth["w"] ** 2)
    found = []
    for kill, following in zip(kills, [*kills[1:], None], strict=True):
        end_s = following.time_s if following else np.inf
        now = int(np.searchsorted(t, kill.time_s))
        after, before = (t >= kill.time_s) & (t < end_s), (t >= kill.time_s - 1.0) & (t <= kill.time_s)
        near = after & (t < kill.time_s + _JUDGED_S)
        hovered = kill.item in HOVERS and speed[now] < _SLOW_M_S
        still = bool(hovered and following is not None and following.item == kill.item)
        away = np.linalg.norm(place[near] - place[now], axis=1)
        found.append(
            AutopilotKill(
                kill.time_s,
                kill.phase,
                kill.item,
                bool(hovered),
                still,
                float(tilt[after].max()),
                float(tilt[before].max()),
                float(place[now, 2] - place[near, 2].min()) if still else 0.0,
                float(away.max()) if still else 0.0,
                kill.went_on,
            )
        )
    return found
