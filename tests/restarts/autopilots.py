"""Autopilots killed in flight: one mission after another, each with as many kills as it has time for, each judged."""

import random
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep
from typing import NamedTuple

import numpy as np

from mavlink.feedback import Feedback
from tests.restarts.between import Between, Phase
from tests.restarts.station import HOVERS, Station, mission
from tests.runs import Array, Process, rows

GIVE_UP_AFTER_S = 60.0
"""By the clock: a bound for what hangs, never a part of a verdict."""
_FIRST_S, _APART_S, _SPREAD_S = 0.2, 1.8, 1.6
_JUDGED_S = 2.0
_SLOW_M_S = 0.3
_LOOK_S = 0.02
_COMPUTES_S = 1.5e-3


class Kill(NamedTuple):
    """What came of a kill.

    Attributes:
        time_s: Simulated time of the frame in which it died.
        phase: Where in the exchange.
        item: Of the mission, then current.
        hovered: Whether the vehicle was hovering.
        tilt_deg: The largest before the next kill.
        tilt_before_deg: The largest in the second before.
        lost_m: Height lost, of a vehicle that hovered.
        moved_m: How far it moved from its place, of a vehicle that hovered.
        went_on: Whether the autopilot said that it goes on.
    """

    time_s: float
    phase: Phase
    item: int
    hovered: bool
    tilt_deg: float
    tilt_before_deg: float
    lost_m: float
    moved_m: float
    went_on: bool


class Flight(NamedTuple):
    """What came of a mission.

    Attributes:
        kills: In order.
        flown: Whether the mission ended.
        duration_s: Simulated.
        words: What was said on standard error, of which there should be nothing.
    """

    kills: list[Kill]
    flown: bool
    duration_s: float
    words: str


class HangsError(Exception):
    """Something was waited for in vain."""


def fly(folder: Path, feedback: Feedback, seed: int, most_kills: int) -> Flight:
    """Fly the mission once, the autopilot killed at random instants and started again at once."""
    folder.mkdir()
    chance = random.Random(seed)
    station = Station(mission())
    plant = Process(folder, "plant", "--link", "udpin:127.0.0.1:0", "--out", str(folder), *_plant(seed))
    processes = [plant]
    try:
        _, host, port = plant.wait_for("listening")["url"].split(":")
        between = Between((host, int(port)))
        kills = _killed(folder, between, station, processes, feedback, chance, most_kills)
        between.close()
    finally:
        for process in processes:
            process.stop()
        station.close()
    words = "".join(process.errors() for process in processes)
    truth = rows(folder / "plant.csv")
    return Flight(judged(truth, kills), station.flown, float(truth["t"][-1]), words)


def start(folder: Path, url: str, station: Station, feedback: Feedback) -> Process:
    """Start an autopilot that keeps its flight."""
    options = ("--plant", url, f"--gcs={station.url}", "--feedback", feedback, "--state", str(folder / "state"))
    return Process(folder, "autopilot", *options)


class _Killed(NamedTuple):
    time_s: float
    phase: Phase
    item: int
    went_on: bool


def _killed(
    folder: Path,
    between: Between,
    station: Station,
    processes: list[Process],
    feedback: Feedback,
    chance: random.Random,
    most: int,
) -> list[_Killed]:
    """Fly, and kill; return when."""
    kills: list[_Killed] = []

    def pump_until(condition: Callable[[], bool], what: str) -> None:
        give_up_s = monotonic() + GIVE_UP_AFTER_S
        while not condition():
            if between.pump([station.socket], _LOOK_S):
                station.hear()
            if monotonic() > give_up_s:
                said = f"{station.mode}, item {station.seq}, {station.texts[-3:]}"
                raise HangsError(f"waited in vain for {what} at t = {between.time_us * 1e-6:.3f} s: {said}")

    def kill() -> None:
        if phase is Phase.DURING:
            sleep(chance.uniform(0.0, _COMPUTES_S))
        processes[-1].process.kill()

    processes.append(start(folder, between.url, station, feedback))
    pump_until(lambda: station.armed is True, "the rotors to be armed")
    due_s = between.time_us * 1e-6 + chance.uniform(0.0, _FIRST_S + _SPREAD_S)
    while len(kills) < most:
        phase = chance.choice(list(Phase))
        between.at(round(due_s * 1e6), phase, kill)
        pump_until(lambda: station.flown or not between.waits, "the instant of the kill")
        if station.flown:
            return kills
        processes[-1].process.wait()
        died_us, item = between.time_us, station.seq
        station.texts.clear()
        between.cut()
        processes.append(start(folder, between.url, station, feedback))
        pump_until(lambda: between.time_us > died_us, "the flight to go on")
        pump_until(lambda: station.flown or _is_said(station), "the words that it goes on")
        kills.append(_Killed(died_us * 1e-6, phase, item, _is_said(station)))
        due_s = died_us * 1e-6 + _APART_S + chance.uniform(0.0, _SPREAD_S)
    pump_until(lambda: station.flown, "the end of the mission")
    return kills


def judged(truth: dict[str, Array], kills: list[_Killed]) -> list[Kill]:
    """Return what the vehicle did after each kill."""
    t, place = truth["t"], np.stack([truth[axis] for axis in "xyz"], axis=1)
    tilt = np.degrees(np.arccos(np.clip(1.0 - 2.0 * (truth["qx"] ** 2 + truth["qy"] ** 2), -1.0, 1.0)))
    speed = np.sqrt(truth["u"] ** 2 + truth["v"] ** 2 + truth["w"] ** 2)
    found = []
    for kill, following in zip(kills, [*kills[1:], None], strict=True):
        end_s = following.time_s if following else np.inf
        now = int(np.searchsorted(t, kill.time_s))
        after, before = (t >= kill.time_s) & (t < end_s), (t >= kill.time_s - 1.0) & (t <= kill.time_s)
        near = after & (t < kill.time_s + _JUDGED_S)
        hovered = kill.item in HOVERS and speed[now] < _SLOW_M_S
        away = np.linalg.norm(place[near] - place[now], axis=1)
        found.append(
            Kill(
                kill.time_s,
                kill.phase,
                kill.item,
                bool(hovered),
                float(tilt[after].max()),
                float(tilt[before].max()),
                float(place[now, 2] - place[near, 2].min()) if hovered else 0.0,
                float(away.max()) if hovered else 0.0,
                kill.went_on,
            )
        )
    return found


def _is_said(station: Station) -> bool:
    return any("restarted in flight" in text for text in station.texts)


def _plant(seed: int) -> tuple[str, ...]:
    return ("--vehicle", "hummingbird", "--start", "y=0,z=0,psi=90,rotors=0", "--seed", str(seed))
