import os
import signal
from time import sleep

import pytest

from colibri.campaigns.engines import in_order, with_bar
from colibri.campaigns.factors import CampaignError


def late(job: int) -> int:
    sleep(0.2 / (1 + job))
    return job * job


def deadly(_job: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return 0


def test_results_are_ordered_and_kept_as_they_come() -> None:
    kept: list[int] = []
    assert in_order(late, range(5), "jobs", quiet=True, keep=kept.append) == [0, 1, 4, 9, 16]
    assert sorted(kept) == [0, 1, 4, 9, 16]


def test_a_job_that_kills_whoever_does_it_is_one_line() -> None:
    with pytest.raises(
        CampaignError, match="jobs: the process that did 7 was killed, and again when it did this alone"
    ):
        in_order(deadly, [7], "jobs", quiet=True)


@pytest.mark.parametrize("quiet", [False, True])
def test_a_bar_changes_nothing_of_what_is_done(quiet: bool, capsys: pytest.CaptureFixture[str]) -> None:
    assert list(with_bar(iter("abc"), "letters", 3, quiet=quiet)) == ["a", "b", "c"]
    assert capsys.readouterr().out == ""
