from pathlib import Path
from typing import Any

import pytest

import colibri
from colibri.campaigns.factors import CampaignError
from colibri.campaigns.flights import common_of
from colibri.campaigns.journal import JOURNAL, Journal, open_journal
from tests.support.campaigns import MASS, SHORT, flown, planned

GRID: dict[str, Any] = {"track": ["hover"], MASS: [0.7, 0.71]}


def opened(folder: Path, *, resume: bool = True, **tables: Any) -> Journal:
    campaign = planned(**({"grid": GRID, "metrics": ["rmse_m", "lost_at_s"]} | tables))
    return open_journal(folder, campaign, common_of(campaign), resume=resume)


@pytest.fixture
def begun(tmp_path: Path) -> Path:
    with opened(tmp_path / "out") as journal:
        for each in flown(grid=GRID, metrics=["rmse_m", "lost_at_s"]):
            journal.add(each)
    return tmp_path / "out"


def test_what_was_kept_is_there_again(begun: Path) -> None:
    with opened(begun) as journal:
        assert list(journal.kept.values()) == flown(grid=GRID, metrics=["rmse_m", "lost_at_s"])


def test_a_line_that_was_cut_off_is_flown_again(begun: Path) -> None:
    journal = begun / JOURNAL
    content = journal.read_bytes()
    for cut in range(len(content) - content.index(b"\n")):
        journal.write_bytes(content[: len(content) - cut])
        with opened(begun) as again:
            assert list(again.kept) == ([0, 1] if cut == 0 else [0])
    with opened(begun) as again:
        again.add(flown(grid=GRID, metrics=["rmse_m", "lost_at_s"])[1])
    assert journal.read_bytes() == content


def test_a_line_that_is_none_is_named(begun: Path) -> None:
    journal = begun / JOURNAL
    journal.write_bytes(b"[0]\n" + journal.read_bytes())
    with pytest.raises(CampaignError, match=r"journal.jsonl: line 1: .*: remove the line, its flight is flown again"):
        opened(begun)


def test_it_goes_on_only_where_that_was_asked_for(begun: Path) -> None:
    with pytest.raises(CampaignError, match="out has 2 of the 2 flights of this campaign: continue with --resume, or"):
        opened(begun, resume=False)


@pytest.mark.parametrize(
    ("changed", "differ"),
    [
        ({"grid": GRID | {MASS: [0.7, 0.72]}}, "contents, grid, objects"),
        ({"seeds": 3}, "seeds"),
        ({"root_seed": 3}, "root_seed"),
        ({"metrics": ["rmse_m"]}, "metrics"),
        ({"logs": "all"}, "logs"),
        ({"fly": {"duration": 0.3}}, "fly, objects"),
        ({"draw": {"latency": {"uniform": [0, 1]}}}, "draw"),
    ],
)
def test_a_folder_with_another_campaign_is_left_alone(begun: Path, changed: dict[str, Any], differ: str) -> None:
    before = {path: path.read_bytes() for path in begun.iterdir()}
    with pytest.raises(CampaignError, match=r"has another campaign \(.*\): choose another folder") as refused:
        opened(begun, **changed)
    assert set(str(refused.value).split("(")[1].split(" differ")[0].split(", ")) <= set(differ.split(", "))
    assert {path: path.read_bytes() for path in begun.iterdir()} == before


def test_a_file_that_changed_is_another_campaign(tmp_path: Path) -> None:
    track = tmp_path / "points.csv"
    track.write_text("t,x,y,z\n0,0,0,2\n5,1,0,2\n", encoding="utf-8")
    grid = {"track": [f"waypoints:{track}"]}
    opened(tmp_path / "out", grid=grid).__exit__()
    track.write_text("t,x,y,z\n0,0,0,2\n5,2,0,2\n", encoding="utf-8")
    with pytest.raises(CampaignError, match=r"has another campaign \(contents differ\)"):
        opened(tmp_path / "out", grid=grid)


@pytest.mark.parametrize("profile", ["flight", colibri.load_profile("flight")])
def test_the_law_of_a_profile_that_changed_is_another_campaign(
    profile: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fly = SHORT | {"profile": profile}
    opened(tmp_path / "out", fly=fly).__exit__()
    monkeypatch.setattr("colibri.campaigns.journal.origin_of", lambda name: (name, "their-laws 2.0", ""))
    with pytest.raises(CampaignError, match=r"has another campaign \(contents differ\)"):
        opened(tmp_path / "out", fly=fly)


def test_a_folder_with_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("", encoding="utf-8")
    with pytest.raises(CampaignError, match="is not empty and does not contain a campaign: choose another folder"):
        opened(tmp_path)


def test_a_folder_that_was_not_begun_to_its_end_is_begun_again(tmp_path: Path) -> None:
    (tmp_path / "campaign.new").write_bytes(b'{"name": "cam')
    with opened(tmp_path) as journal:
        assert not journal.kept
    assert {path.name for path in tmp_path.iterdir()} == {"campaign.json", JOURNAL}


def test_an_identity_that_cannot_be_read_is_one_line(begun: Path) -> None:
    (begun / "campaign.json").write_bytes(b"{")
    with pytest.raises(CampaignError, match=r"cannot use --out .*out: .*truncated"):
        opened(begun)
