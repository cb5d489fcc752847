from typing import Any

import msgspec
import numpy as np
import pytest

from colibri.autopilot.control.lpv_mpc.law import LpvMpc
from colibri.autopilot.control.profile import Profile, ProfileError, load_profile
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.track_stages import TrackStages, track_autopilot
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.common.rotations import quaternion_from_euler
from colibri.mavlink.hil.state import StateFrame
from colibri.plant.vehicle.description import load_vehicle

VEHICLE = load_vehicle("hummingbird")


def flight(**simulation: Any) -> Profile:
    profile = load_profile("flight")
    return msgspec.structs.replace(profile, simulation=msgspec.structs.replace(profile.simulation, **simulation))


def build(profile: Profile) -> Autopilot[TrackStages]:
    return track_autopilot(profile, VEHICLE, track("spiral"), lambda: 0.0)


def frame(time_us: int, psi: float = 1.57) -> StateFrame:
    return StateFrame(time_us, (2.0, 0.0, 2.0), (0.0, 0.3, 0.0), quaternion_from_euler(0.0, 0.0, psi), (0.0, 0.0, 0.0))


def test_between_two_control_samples_the_last_command_holds() -> None:
    autopilot = build(flight())
    steps = [autopilot.step(frame(4000 * number)) for number in range(6)]
    assert [step.decision is not None for step in steps] == [True, False] * 3
    assert [step.command.time_us for step in steps] == [4000 * number for number in range(6)]
    for decided, held in zip(steps[::2], steps[1::2], strict=True):
        assert held.command.controls == decided.command.controls


def test_it_hovers_until_the_next_control_sample() -> None:
    autopilot = build(flight())
    first, second = autopilot.step(frame(1_004_000)), autopilot.step(frame(1_008_000))
    assert first.decision is None
    assert first.command.controls == pytest.approx((VEHICLE.hover_speed / VEHICLE.rotors.max_speed,) * 4)
    assert second.decision is not None


def test_a_gap_in_the_frames_begins_anew() -> None:
    autopilot, other = build(flight()), build(flight())
    for number in range(10):
        autopilot.step(frame(4000 * number, psi=1.2))
    assert autopilot.step(frame(800_000)).command == other.step(frame(800_000)).command


def test_yaw_is_unwrapped_by_continuity() -> None:
    autopilot = build(flight())
    decisions = [autopilot.step(frame(4000 * n, psi=1.57 + 0.05 * n)).decision for n in range(252)]
    last = decisions[-2]
    assert last is not None
    predicted = last.diagnostics.predicted
    assert predicted is not None
    assert predicted[0, LpvMpc.plan_columns.psi] == pytest.approx(1.57 + 0.05 * 250)
    assert abs(last.attitude_reference[2] - predicted[0, LpvMpc.plan_columns.psi]) <= np.pi


@pytest.mark.parametrize(
    ("wanted_s", "interval_us"), [(0.004, 4000), (0.008, 8000), (0.005, 4000), (0.001, 1000), (0.1, 8000), (None, 8000)]
)
def test_frames_divide_the_control_interval(wanted_s: float | None, interval_us: int) -> None:
    assert build(flight(frame_interval_s=wanted_s)).frame_interval_us == interval_us


def test_a_profile_without_the_law_names_those_it_has() -> None:
    with pytest.raises(ProfileError, match="profile flight has no numbers for controller cascade, only for lpv-mpc, "):
        build(msgspec.structs.replace(flight(), controller="cascade"))
