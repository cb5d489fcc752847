import json
from argparse import ArgumentTypeError, Namespace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from colibri.analysis.limits import LossLimit, limit, loss_limit
from colibri.campaigns.engines import Pool
from colibri.campaigns.flights import FlightResult, Verdict
from colibri.campaigns.gate import handed_over
from colibri.campaigns.results import CampaignResults
from tests.support.campaigns import Here, planned
from tests.support.commands import Ran

LOST = {0: Verdict.LOST, 1: Verdict.REFUSED}
FLIGHTS = 4


def made(verdicts: dict[int, Verdict]) -> CampaignResults:
    campaign = planned(metrics=["rmse_m", "max_tilt_deg"], seeds=f"1-{FLIGHTS}")
    rows = {
        flight: FlightResult(flight, verdicts.get(flight, Verdict.FLOWN), "too low", (0.1 * flight, None), "hash")
        for flight in range(FLIGHTS)
    }
    return CampaignResults(campaign, rows)


@pytest.mark.parametrize(
    ("verdicts", "most", "above", "said", "failed"),
    [
        ({}, "0", [], "", 0),
        (LOST, "2", [], "", 0),
        (LOST, "1", [], "--fail-lost: 2 of 4 flights were lost or refused, above 1", 2),
        (LOST, "50%", [], "", 0),
        (LOST, "49%", [], "--fail-lost: 2 of 4 flights were lost or refused, above 49%", 2),
        (LOST, None, [], "", 0),
        (dict.fromkeys(range(FLIGHTS), Verdict.LOST), None, [], "all 4 flights were lost or refused", 4),
        ({}, None, ["rmse_m=0.15"], "--fail-above: rmse_m is above 0.15 in 2 of 4 flights", 2),
        (LOST, None, ["rmse_m=0.25"], "--fail-above: rmse_m is above 0.25 in 1 of 4 flights", 1),
        ({}, None, ["max_tilt_deg=1"], "--fail-above: max_tilt_deg is above 1 or unknown in 4 of 4 flights", 4),
    ],
)
def test_exit_code_message_json_and_junit_agree(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    verdicts: dict[int, Verdict],
    most: str | None,
    above: list[str],
    said: str,
    failed: int,
) -> None:
    allowed = None if most is None else loss_limit(most)
    args = Namespace(
        fail_lost=allowed, fail_above=list(map(limit, above)), json=True, junit=tmp_path / "a" / "j.xml", out=tmp_path
    )
    code = handed_over(made(verdicts), args)
    out, err = capsys.readouterr()
    assert code == (1 if said else 0)
    assert err == (f"colibri: error: {said}\n" if said else "")
    facts = json.loads(out)
    assert facts["exceeded"] == ([said] if said else [])
    assert (facts["flights"], facts["verdicts"]["flown"]) == (FLIGHTS, FLIGHTS - len(verdicts))
    (row,) = facts["summary"]
    assert all(name.isidentifier() for name in row)
    suite = ElementTree.parse(args.junit).getroot()
    assert (suite.get("tests"), suite.get("failures")) == (str(FLIGHTS), str(failed))
    assert len(suite.findall("testcase/failure")) == failed


@pytest.mark.parametrize("text", ["-1", "1.5", "x", "", "101%", "%", "nan%"])
def test_no_limit_of_losses_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(
        ArgumentTypeError, match="must be a number of flights or a percentage, for example 3 or 5%, not "
    ):
        loss_limit(text)


def test_a_limit_of_losses_is_a_number_or_a_share() -> None:
    assert (loss_limit("3"), loss_limit("2.5%")) == (LossLimit(3.0), LossLimit(2.5, percent=True))


@pytest.mark.parametrize(
    "command", [["fly", "hover"], ["campaign", "--track", "hover"], ["compare", "--track", "hover"]]
)
def test_every_command_has_limits_and_json(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ran: Ran
) -> None:
    monkeypatch.setattr(Pool, "each", Here().each)
    options = ["--link", "memory", "--profile", "flight", "--duration", "0.2", "--start", "x=0.1,z=2", "--json"]
    if command[0] == "fly":
        options.append("--no-figures")
    for above, code in (("rmse_m=9", 0), ("rmse_m=0", 1)):
        said = ran(
            *command, *options, "--fail-above", above, "--fail-lost", "100%", "--out", tmp_path / above, code=code
        )
        assert isinstance(json.loads(said.out), dict)
        assert ("--fail-above: rmse_m is " in said.err) == bool(code)
