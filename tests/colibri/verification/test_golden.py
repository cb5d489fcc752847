import json
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.control.registry import GROUP
from colibri.autopilot.guidance.trajectories.tracks import THESIS_TRACKS
from colibri.cli.options import GOLDEN_HASHES
from colibri.sitl.vehicle import Sitl
from colibri.verification import golden_flights
from colibri.verification import verify as golden
from colibri.verification.golden_flights import SitlCase, TrackCase
from tests.support.commands import Ran

SHORT = TrackCase("short", {"track": "line", "profile": "se3", "duration": 0.4})
CORNER = TrackCase("corner", {"track": "waypoints", "profile": "se3", "duration": 0.4}, golden_flights.WAYPOINTS)


def hop(sitl: Sitl) -> None:
    sitl.run(0.1)


HOP = SitlCase(name="hop", orders=hop, setting={"airborne": 2.0})
WRONG = "0" * 64


@pytest.fixture
def hashes(tmp_path: Path) -> Path:
    return tmp_path / "golden" / "hashes.json"


@pytest.fixture
def verify(tmp_path: Path, hashes: Path, monkeypatch: pytest.MonkeyPatch, ran: Ran) -> Ran:
    monkeypatch.setattr(golden, "FLIGHTS", (SHORT, CORNER, HOP))
    return partial(ran, "verify", "--golden", hashes, "--link", "memory", "--out", tmp_path / "out")


def test_what_was_renewed_is_the_same_and_says_what_changed(verify: Ran, hashes: Path, tmp_path: Path) -> None:
    assert "3 of 3 changed" in " ".join(verify("--renew").out.split())
    known = json.loads(hashes.read_text(encoding="utf-8"))
    assert list(known) == ["short", "corner", "hop"]
    table = verify().out
    assert table.count("the same") == 3
    assert known["hop"][:16] in table
    found = json.loads((tmp_path / "out" / golden.FOUND).read_text(encoding="utf-8"))
    assert {name: outcome["sha256"] for name, outcome in found.items()} == known
    assert all(outcome["wall_time_s"] > 0.0 for outcome in found.values())
    assert "nothing changed" in verify("--renew").out


def test_what_differs_is_named_with_both_hashes(verify: Ran, hashes: Path) -> None:
    verify("--renew", "--quiet")
    known = json.loads(hashes.read_text(encoding="utf-8"))
    hashes.write_text(json.dumps(known | {"corner": WRONG}), encoding="utf-8")
    said = verify(code=1)
    assert f"not as in {hashes}: corner; the logs are in" in said.err
    (line,) = (line for line in said.out.splitlines() if "corner" in line)
    assert WRONG[:16] in line
    assert known["corner"][:16] in line
    verify("--only", "short", "--only", "hop", "--quiet")


def test_one_flight_is_renewed_and_non_flights_are_dropped(verify: Ran, hashes: Path) -> None:
    verify("--renew", "--quiet")
    known = json.loads(hashes.read_text(encoding="utf-8"))
    hashes.write_text(json.dumps({"gone": WRONG, "hop": WRONG, "short": WRONG}), encoding="utf-8")
    table = " ".join(verify("--renew", "--only", "short").out.split())
    assert json.loads(hashes.read_text(encoding="utf-8")) == {"short": known["short"], "hop": WRONG}
    assert "2 of 2 changed" in table
    assert "gone" in table
    assert "hop" not in table


def hop_to_the_moon(sitl: Sitl) -> None:
    sitl.wait_until(lambda: sitl.position[2] > 4e8, within=0.1, what="the hop")


def test_a_flight_that_does_not_end_differs_and_is_not_renewed(
    verify: Ran, hashes: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    verify("--renew", "--quiet")
    before = hashes.read_bytes()
    monkeypatch.setattr(golden, "FLIGHTS", (SHORT, CORNER, SitlCase(name="hop", orders=hop_to_the_moon)))
    said = verify(code=1)
    assert "the hop took longer" in " ".join(said.out.split())
    assert f"not as in {hashes}: hop;" in said.err
    assert "hop did not end" in verify("--renew", code=1).err
    assert hashes.read_bytes() == before


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no golden hashes in"),
        ("short: 12", "holds no golden hashes"),
        ('{"short": "12"}', "holds no golden hashes"),
        ('["short"]', "holds no golden hashes"),
        (json.dumps({"short": WRONG, "corner": WRONG}), "has no hash of golden flight hop: write it again"),
        (json.dumps(dict.fromkeys(("short", "corner", "hop", "leap"), WRONG)), "names leap, which is not a golden"),
    ],
)
def test_a_file_that_does_not_fit_the_set_is_refused_in_one_line(
    verify: Ran, hashes: Path, content: str | None, words: str
) -> None:
    hashes.parent.mkdir()
    if content is not None:
        hashes.write_text(content, encoding="utf-8")
    said = verify(code=2)
    assert words in said.err
    assert str(hashes) in said.err
    assert said.err.count("\n") == 1
    assert not said.out


@pytest.mark.long
def test_both_kinds_of_flight_are_the_same_over_udp(tmp_path: Path) -> None:
    for flight in (SHORT, HOP):
        flown = [golden.fly_golden(flight, tmp_path / flight.name / link, link) for link in ("memory", "udp")]
        assert flown[0].sha256 == flown[1].sha256 != ""


def test_the_file_of_the_project_names_the_set_in_its_order() -> None:
    """`colibri verify --golden --renew --only NAME` adds what is missing, and drops what is no flight any more."""
    known = golden.read_hashes(Path(__file__).parents[3] / GOLDEN_HASHES)
    assert list(known) == [flight.name for flight in golden_flights.FLIGHTS]


def law_of(flight: TrackCase | SitlCase) -> str:
    options = flight.options if isinstance(flight, TrackCase) else flight.setting
    return load_profile(options.get("profile", "flight")).with_choices(options.get("controller"), None).controller


def test_every_control_law_has_a_golden_flight() -> None:
    laws = [law.name for law in entry_points(group=GROUP) if law.dist and law.dist.name == "colibri-sitl"]
    missing = sorted(set(laws) - {law_of(flight) for flight in golden_flights.FLIGHTS})
    assert len(laws) >= 4
    assert not missing, (
        f"no golden flight for control law {', '.join(missing)}: add one to colibri/verification/golden_flights.py, "
        "then colibri verify --golden --renew --only NAME"
    )


@pytest.mark.parametrize("profile", ["flight", "thesis"])
def test_every_track_of_the_thesis_has_a_golden_flight(profile: str) -> None:
    tracks = [
        flight.options["track"]
        for flight in golden_flights.FLIGHTS
        if isinstance(flight, TrackCase) and flight.options["profile"] == profile
    ]
    assert set(THESIS_TRACKS) <= set(tracks)
