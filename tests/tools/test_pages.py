"""Pages that are written from the code say what the code says, and what their measures are."""

from pathlib import Path

import numpy as np
import pytest

from tools.pages.__main__ import main
from tools.pages.payload import PAYLOAD_KG, draw, fly
from tools.pages.rotor_loss import CASES, SEEDS, RotorLossFlight, measured, table
from tools.pages.tables import with_tables

DOCS = Path(__file__).parents[2] / "docs"


def test_a_table_replaces_the_one_with_its_headings() -> None:
    page = "a\n\n| x |\n|---|\n| 1 |\n\n| y |\n|---|\n| 2 |\n\n| x |\n|---|\n| 3 |\n"
    assert with_tables(page, ["| x |\n|---|", "| x |\n|---|\n| 4 |"]) == (
        "a\n\n| x |\n|---|\n\n| y |\n|---|\n| 2 |\n\n| x |\n|---|\n| 4 |\n"
    )
    with pytest.raises(AssertionError, match=r"no table \| z \|"):
        with_tables(page, ["| z |\n|---|"])


@pytest.mark.parametrize("page", ["failsafes", "faults", "modes"])
def test_a_page_is_written_with_its_pictures(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written = tmp_path / f"{page}.md"
    written.write_bytes((DOCS / f"{page}.md").read_bytes())
    monkeypatch.setattr("sys.argv", ["pages", page, str(tmp_path)])
    assert main() == 0
    assert written.read_bytes() == (DOCS / f"{page}.md").read_bytes()
    assert (tmp_path / f"{page}.png").exists() is (DOCS / f"{page}.png").exists()


@pytest.mark.parametrize("page", ["tables", "latence"])
def test_a_wrong_page_is_refused(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["pages", page, str(tmp_path)])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert page in capsys.readouterr().err.splitlines()[-1]


def flown(seed: int = 0, *, drift_m_s: float = 0.1, tilt_deg: float = 15.0, rights: bool = True) -> RotorLossFlight:
    """Return a flight that tilts to 40° for 0.2 s, sinks from 4 m at 1 m/s, and rests after a touch-down at 4 s."""
    t = np.arange(-100, 1250) * 0.004
    after = np.maximum(t, 0.0)
    on_ground = t >= 4.0
    z = np.where(on_ground, 0.0, 4.0 - after)
    tilt = np.where(on_ground, 0.0, np.where((t > 0.0) & (t <= 0.2), 40.0, tilt_deg))
    vz = np.where(on_ground | (t <= 0.0), 0.0, -1.0)
    controls = np.full((t.size, 4), 0.5)
    path = np.column_stack([t, drift_m_s * after, 0.0 * t, z, vz, tilt, -5.0 * after, controls])
    return measured(seed, 0.02, path, rights=rights)


def test_the_measures_of_a_flight() -> None:
    flight = flown()
    assert flight.peak_deg == 40.0
    assert flight.upright_s == pytest.approx(0.2)
    assert flight.settled_deg == 15.0
    assert flight.landed_m == pytest.approx(0.4, abs=0.01)
    assert flight.max_distance_m == pytest.approx(0.4, abs=0.01)
    assert flight.touched_m_s == 1.0
    assert flight.spin_rad_s == pytest.approx(20.0, abs=0.1)
    assert flight.rest_deg == 0.0
    assert flight.well


def test_what_is_not_well() -> None:
    assert not flown(tilt_deg=21.0).well
    assert not flown(drift_m_s=1.5).well
    assert not flown(rights=False).well


def test_the_table_has_the_median_and_the_worst() -> None:
    of = [flown(0), flown(1, tilt_deg=17.0), flown(2, tilt_deg=22.0)]
    assert "| 2 of 3 |" in table({CASES[0]: of})
    assert "| 17.0; 22.0 |" in table({CASES[0]: of})


def test_the_page_tells_of_every_case_and_all_seeds() -> None:
    lines = (DOCS / "rotor-loss.md").read_text(encoding="utf-8").splitlines()
    for case in CASES:
        (row,) = (line for line in lines if line.startswith(f"| {case.name} |"))
        assert f" of {len(SEEDS)} |" in row


SECONDS = (0.5, 2.5, 3.5)


def test_a_payload_is_felt_at_once_and_told_where_it_is_learned() -> None:
    flown = {
        label: fly(None, learns=label == "mass learned", seconds=SECONDS)
        for label in ("mass learned", "mass not learned")
    }
    for laden in flown.values():
        assert -0.015 < laden.height_error_m.min() < -0.005
        assert 0.004 < laden.height_error_m[laden.t > SECONDS[1]].max() < 0.015
    learned, kept = (laden.told[:, 1] for laden in flown.values())
    assert kept.max() == kept.min() == pytest.approx(learned[0], rel=1e-5)
    assert 0.2 * PAYLOAD_KG < learned.max() - learned[0] < PAYLOAD_KG
    assert len(draw({"hover": flown, "lemniscate": flown}).axes) == 3
