from functools import cache
from pathlib import Path

import pytest

from colibri.tuning.trials import JOURNAL, Begun, FinishedTrial, Trials
from tests.support.tuning import POSITION, RATE, planned


def end(trials: Trials, begun: Begun) -> None:
    """End a trial with a value that follows from what it tried."""
    value = abs(begun.params[POSITION] - 300.0) + begun.params[RATE]
    trials.tell(begun, FinishedTrial(begun.number, (value,), begun.params, 4, 0, False, {}))


planned_for = cache(lambda trials: planned(trials=trials))


def all_of(folder: Path, trials: int = 14) -> list[FinishedTrial]:
    with Trials(folder, planned_for(trials)) as shared:
        while (begun := shared.ask()) is not None:
            end(shared, begun)
        return shared.ended


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> list[FinishedTrial]:
    return all_of(tmp_path_factory.mktemp("expected"))


@pytest.fixture(scope="module")
def half(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return the journal of 11 trials, and one that was begun."""
    folder = tmp_path_factory.mktemp("half")
    with Trials(folder, planned_for(14)) as shared:
        for _ in range(11):
            begun = shared.ask()
            assert begun is not None
            end(shared, begun)
        shared.ask()
    return (folder / JOURNAL).read_bytes()


def plain(trials: list[FinishedTrial]) -> list[tuple[object, ...]]:
    return [(trial.number, trial.values, trial.params) for trial in trials]


def test_the_first_trial_is_the_profile_as_it_is(expected: list[FinishedTrial]) -> None:
    assert expected[0].params == {POSITION: 100.0, RATE: 0.015}
    for trial in expected:
        assert all(value == float(f"{value:.4g}") for value in trial.params.values())
    assert len({trial.params[POSITION] for trial in expected}) == 14


def test_a_root_seed_is_another_tuning(tmp_path: Path, expected: list[FinishedTrial]) -> None:
    with Trials(tmp_path, planned(root_seed=1)) as shared:
        for trial in expected[:2]:
            begun = shared.ask()
            assert begun is not None
            assert begun.number == trial.number
            assert (begun.params == trial.params) is (begun.number == 0)
            end(shared, begun)


@pytest.mark.parametrize("cut", range(1, 30, 4))
def test_another_process_continues_the_tuning(
    cut: int, half: bytes, tmp_path: Path, expected: list[FinishedTrial]
) -> None:
    lines = half.splitlines(keepends=True)
    kept = b"".join(lines[: len(lines) - cut])
    (tmp_path / JOURNAL).write_bytes(kept + lines[len(lines) - cut][: 3 * cut])  # killed while it wrote
    assert plain(all_of(tmp_path)) == plain(expected)


def test_more_trials_go_on_where_it_ended(tmp_path: Path, expected: list[FinishedTrial]) -> None:
    assert plain(all_of(tmp_path, 9)) == plain(expected[:9])
    assert plain(all_of(tmp_path)) == plain(expected)


def test_who_is_alive_keeps_its_trial_and_who_is_not_does_not(tmp_path: Path) -> None:
    tuning = planned(trials=3)
    with Trials(tmp_path, tuning) as one, Trials(tmp_path, tuning) as other:
        first = one.ask()
        assert first is not None
        end(one, first)
        mine, theirs = one.ask(), other.ask()
        assert mine is not None
        assert theirs is not None
        assert (mine.number, theirs.number) == (1, 2)
        assert mine.params != theirs.params
        end(other, theirs)
        one.__exit__()
        again = other.ask()
        assert again is not None
        assert again.number == 1
        end(other, again)
        assert other.ask() is None
        assert [trial.number for trial in other.ended] == [0, 1, 2]


def test_importances_tell_what_matters(tmp_path: Path) -> None:
    all_of(tmp_path, 30)
    with Trials(tmp_path, planned(trials=30)) as shared:
        (parts,) = shared.importances()
    assert sum(parts.values()) == pytest.approx(1.0)
    assert parts[POSITION] > 0.7
