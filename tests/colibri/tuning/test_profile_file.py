from operator import attrgetter
from pathlib import Path

import pytest

import colibri
from colibri.autopilot.control.profile import profile_names, profile_text
from colibri.tuning.results import profile_file, tuned_name
from tests.support.tuning import POSITION, WEIGHTS

BLOCK = "profile.controllers.lpv-mpc.plan.blocks.0"
POLES = "profile.controllers.lpv-mpc.guidance.poles"


def read(text: str, folder: Path) -> colibri.Profile:
    path = folder / "profile.toml"
    path.write_text(text, encoding="utf-8")
    return colibri.load_profile(str(path))


def test_comments_stay_and_numbers_change(tmp_path: Path) -> None:
    base = colibri.load_profile("flight")
    tuned = base.replace(f"{WEIGHTS}.position", 250.0).replace(BLOCK[8:], 2).replace(POLES[8:], [-6.5, -8.0])
    text = profile_file(base, profile_text("flight"), tuned, [POSITION, BLOCK, POLES], ["Tuned by hand."])
    assert text.startswith(
        "# Tuned by hand.\n"
        "# Tuned numbers, with their original values:\n"
        f"#   {WEIGHTS}.position = 250.0  # 100.0\n"
        "#   controllers.lpv-mpc.plan.blocks.0 = 2  # 1\n"
        "#   controllers.lpv-mpc.guidance.poles = [-6.5, -8.0]  # [-7.0, -8.0]\n"
    )
    before, after = profile_text("flight").splitlines(), text.splitlines()[5:]
    changed = [line for line in after if line not in before]
    now = ['name = "flight-tuned"', "poles = [-6.5, -8.0]", "blocks = [2, 2, 3, 5, 7, 10]", "position = 250.0"]
    assert [line.split("#")[0].strip() for line in changed] == now
    comments = [line.partition("#")[2] for line in before if "#" in line]
    assert comments == [line.partition("#")[2] for line in after if "#" in line]
    written = read(text, tmp_path)
    assert written.name == tuned_name(base) == "flight-tuned"
    assert written.controllers == tuned.controllers
    assert written.simulation == tuned.simulation


@pytest.mark.parametrize("name", profile_names())
def test_every_profile_can_be_written_with_its_file_and_without(name: str, tmp_path: Path) -> None:
    base = colibri.load_profile(name)
    key = "simulation.rotor_speed_rpm"
    tuned = base.replace(key, 4000.0)
    for text in (profile_text(name), None):
        written = read(profile_file(base, text, tuned, [f"profile.{key}"], []), tmp_path)
        kept = attrgetter("controllers", "simulation", "controller", "references", "delay_s")
        assert kept(written) == kept(tuned)


def test_a_file_without_a_name_is_given_one(tmp_path: Path) -> None:
    base = colibri.load_profile("flight")
    text = profile_text("flight").replace('name = "flight"\n', "")
    tuned = base.replace(f"{WEIGHTS}.position", 250.0)
    assert read(profile_file(base, text, tuned, [POSITION], []), tmp_path).name == "flight-tuned"


def test_what_would_not_be_read_back_is_not_written() -> None:
    base = colibri.load_profile("flight")
    tuned = base.replace(f"{WEIGHTS}.position", 250.0)
    with pytest.raises(AssertionError, match="the profile that was written is not the one that was flown"):
        profile_file(base, profile_text("flight"), tuned, [], [])
