"""Paths through waypoints as they are flown: changed so that they can be, everywhere alike, or refused."""

from pathlib import Path

import pytest

from colibri.cli.main import main
from tests.support.paths import DIPS
from tests.support.recorded import rows
from tools.harness.processes import fly


def written(folder: Path, text: str, name: str = "points.csv") -> str:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return f"waypoints:{path}"


def test_a_path_that_dips_is_flown_above_the_ground(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = written(tmp_path, DIPS)
    figures = fly(tmp_path / "out", f"{name},speed=8", "--link", "direct", "--duration", "24")
    capsys.readouterr()
    assert "dip to -1.03 and -0.60 m: held above 0 m" in figures["track_note"]
    assert figures["max_error_m"] < 0.1
    assert rows(tmp_path / "out" / "flight.csv")["z"].min() > 0.1


def test_what_was_changed_is_said_before_the_flight(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("--link", "direct", "--duration", "0.1", "--no-figures", "--out", str(tmp_path / "out"))
    assert main(["fly", written(tmp_path, DIPS), *arguments]) == 0
    said = "legs 1 to 2 and 7 to 8 dip to -1.03 and -0.60 m: held above 0 m"
    assert f"{tmp_path / 'points.csv'}: {said}\n" in capsys.readouterr().err


@pytest.mark.long
def test_a_floor_reaches_the_autopilot_and_its_replay(tmp_path: Path) -> None:
    """With every figure drawn: a name may hold what matplotlib and rich would take for markup."""
    name, options = written(tmp_path, DIPS, "points $x$ [red].csv"), ("--floor", "1", "--duration", "8", "--quiet")
    for link in ("udp", "memory"):
        assert main(["fly", name, *options, "--link", link, "--out", str(tmp_path / link)]) == 0
    same = [(tmp_path / link / "flight.csv").read_bytes() for link in ("udp", "memory")]
    assert same[0] == same[1]
    assert rows(tmp_path / "udp" / "flight.csv")["z_ref"].min() >= 1.0
    assert (tmp_path / "udp" / "trajectory.png").exists()
    assert main(["replay", str(tmp_path / "memory"), "--quiet"]) == 0


def test_a_path_that_may_not_be_changed_ends_before_it_begins(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["fly", written(tmp_path, "x,y,z,t\n0,0,1,0\n30,0,1,2\n"), "--out", str(tmp_path / "out")])
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "points.csv: leg 1 to 2 needs a " in error
    assert not (tmp_path / "out").exists()
