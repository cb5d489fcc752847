from typing import Any

import numpy as np
import pytest
from numpy.random import PCG64, Generator

from colibri.campaigns.factors import CampaignError, read_draw, read_values, shown


def drawn(given: dict[str, Any], count: int = 4000) -> list[Any]:
    chance = Generator(PCG64(1))
    draw = read_draw("key", given)
    return [draw.value(chance) for _ in range(count)]


def test_spans_are_even_in_distance_or_ratio() -> None:
    assert read_values("key", "2:20:10") == (2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0)
    assert read_values("key", {"linspace": [1, 0, 3]}) == (1.0, 0.5, 0.0)
    assert read_values("key", {"logspace": [0.01, 100, 5]}) == (0.01, 0.1, 1.0, 10.0, 100.0)
    assert read_values("key", ["lemniscate:lap=5", "hover"]) == ("lemniscate:lap=5", "hover")
    assert read_values("key", 3) == (3,)


def test_a_list_may_be_long() -> None:
    assert len(read_values("key", range(200_000))) == 200_000


def test_each_distribution_is_what_its_name_says() -> None:
    uniform, logarithms = drawn({"uniform": [0.6, 0.8]}), np.log10(drawn({"log-uniform": [0.01, 100.0]}))
    assert np.quantile(uniform, [0.0, 0.25, 0.5, 0.75, 1.0]) == pytest.approx([0.6, 0.65, 0.7, 0.75, 0.8], abs=0.006)
    assert 0.6 <= min(uniform) <= max(uniform) <= 0.8
    assert np.quantile(logarithms, [0.25, 0.5, 0.75]) == pytest.approx([-1.0, 0.0, 1.0], abs=0.12)
    assert -2.0 <= min(logarithms) <= max(logarithms) <= 2.0
    normal, choice = drawn({"normal": [5.0, 2.0]}), drawn({"choice": ["light", "moderate", "severe"]})
    assert (np.mean(normal), np.std(normal)) == pytest.approx((5.0, 2.0), abs=0.1)
    assert {choice.count(each) // 1000 for each in ("light", "moderate", "severe")} == {1}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (3, "expected one of uniform, log-uniform, normal, choice, as in"),
        ({"uniform": [1, 2], "normal": [1, 2]}, "expected one of"),
        ({"gauss": [1, 2]}, "expected one of"),
        ({"uniform": [2, 1]}, "uniform: 2 to 1 is an empty range"),
        ({"uniform": [1, 1]}, "uniform: 1 to 1 is an empty range"),
        ({"uniform": [1]}, r"expected \[lowest, highest\], not \[1\]"),
        ({"uniform": ["a", "b"]}, r"expected \[lowest, highest\]"),
        ({"uniform": [0.0, float("inf")]}, r"expected \[lowest, highest\]"),
        ({"log-uniform": [0, 1]}, "log-uniform: 0 is not above zero"),
        ({"normal": [0, -1]}, "the standard deviation is negative: -1"),
        ({"normal": 3}, r"expected \[mean, standard deviation\], not 3"),
        ({"choice": []}, "no values: give at least one"),
    ],
)
def test_what_is_no_distribution_is_refused(given: Any, said: str) -> None:
    with pytest.raises(CampaignError, match=f"key: .*{said}"):
        read_draw("key", given)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([], "no values: give at least one"),
        ([1.0, 2.0, 1.0], "1.0 is there twice"),
        ("2:20:1", "2:20:1 is not a range: give FIRST:LAST:COUNT"),
        ("2:2:5", "2:2:5 is not a range"),
        ("2:20:2.5", "2:20:2.5 is not a range"),
        ({"linspace": [1, 2]}, r"linspace: expected \[first, last, how many\]"),
        ({"logspace": [0, 2, 5]}, "logspace: 0 to 2: both must be above zero"),
        ({"range": [1, 2, 3]}, "expected one of linspace, logspace"),
    ],
)
def test_what_is_no_range_is_refused(given: Any, said: str) -> None:
    with pytest.raises(CampaignError, match=f"key: {said}"):
        read_values("key", given)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.1, "0.1"), (True, "true"), (3, "3"), ({"x": 0.5, "z": 2}, "x=0.5,z=2"), (["a", 2.0], "a 2.0"), (int, "int")],
)
def test_values_are_shown_as_a_file_has_them(value: Any, text: str) -> None:
    assert shown(value) == text


@pytest.mark.parametrize(
    ("modules", "names"), [(("before", "after"), ["before.Law", "after.Law"]), (("law", "law"), ["Law (1)", "Law (2)"])]
)
def test_classes_of_one_name_are_told_apart(modules: tuple[str, str], names: list[str]) -> None:
    laws = [type("Law", (), {"__module__": module}) for module in modules]
    assert [level.name for level in read_values("controller", laws)] == names
