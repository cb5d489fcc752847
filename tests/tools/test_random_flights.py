"""Random flights: three of their cases, and what is a failure; `make random-flights` flies hundreds."""

import pytest

from tools.random_flights import RandomEvent, RandomFlight, case_of, fly, main


def case(*events: RandomEvent) -> RandomFlight:
    return RandomFlight(1, "hummingbird", "state", "0@0", None, {}, False, 3.0, 25.0, [*events])


def test_a_seed_is_always_the_same_case() -> None:
    assert case_of(7) == case_of(7) != case_of(8)


@pytest.mark.parametrize(
    ("event", "violated"),
    [
        (RandomEvent(3.0, "inject", ("motor", "off", 0.0)), ""),
        (RandomEvent(3.0, "disarm"), "ValueError at "),
    ],
)
def test_flights_are_judged(event: RandomEvent, violated: str) -> None:
    assert fly(case(event)).violated[:14] == violated


def test_a_failing_seed_says_how_to_repeat(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("tools.random_flights.case_of", lambda _: case(RandomEvent(0.1, "disarm")))
    monkeypatch.setattr("sys.argv", ["random_flights", "--seeds", "3"])
    assert main() == 1
    out = capsys.readouterr().out
    assert out.startswith("FAILED: ValueError at ")
    assert "repeat: python -m tools.random_flights --verbose --seeds 3\n" in out
