"""A companion flies a spiral on real PX4, with PX4's own physics or on our plant.

`python -m tests.peers.tracks PROGRAM FOLDER sihsim|iris|hummingbird`, in a network namespace with loopback alone. PX4's
own physics is identified first. What was flown is in FOLDER/track.json.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path
from time import perf_counter

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.trajectories.loading import load_track
from colibri.companion.guide import Companion
from colibri.companion.identification import identified
from colibri.companion.settings import CompanionSettings
from colibri.plant.vehicle.description import load_vehicle
from tests.peers.half_speed import PATIENT, Bench, on_the_plant, own_physics

DURATION_S = 40.0
HEIGHT_M = 3.0
GIVE_UP_S = 150.0
OWN_PHYSICS = "sihsim"


def main(program: str, folder: Path, name: str) -> None:
    build = Path(program)
    settings = CompanionSettings(may_arm=True, duration_s=DURATION_S, limits=PATIENT)
    with own_physics(build, folder) if name == OWN_PHYSICS else on_the_plant(build, folder, name) as bench:
        if name == OWN_PHYSICS:
            steps = replace(settings, identifies=True, takeoff_height_m=HEIGHT_M)
            hovered = fly(bench, name, f"hover:height={HEIGHT_M}", steps)
            settings = replace(settings, may_arm=False, response=identified(hovered)[0])
        companion = fly(bench, name, "spiral", settings)
    assert companion.ended is not None, "it was flown to its end"
    figures = {
        "in_order": companion.ended.in_order,
        "ended": companion.ended.why,
        "rmse_m": companion.errors.rmse_m(),
        "max_m": companion.errors.max_m,
        "flown_s": companion.errors.flown_s,
        "response": settings.response,
    }
    (folder / "track.json").write_text(json.dumps(figures, indent=1), encoding="utf-8")


def fly(bench: Bench, name: str, track: str, settings: CompanionSettings) -> Companion:
    profile, vehicle = load_profile("flight"), load_vehicle(name)
    path = load_track(track, vehicle, profile).track
    companion = bench.companion = Companion(settings, profile, vehicle, path, perf_counter)
    give_up_us = bench.now_us + round(GIVE_UP_S * 1e6)
    while companion.ended is None:
        if bench.now_us > give_up_us:
            raise SystemExit(f"{companion.phase}: {companion.waits_for}")
        bench.turn()
    return companion


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), sys.argv[3])
