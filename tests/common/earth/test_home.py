from argparse import ArgumentTypeError

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.earth.home import DEFAULT_HOME, HomePlace, home
from tests.support.strategies import reals

HOMES = st.builds(HomePlace, reals(90.0), reals(180.0), st.floats(-500.0, 10_000.0), reals(360.0))


@given(HOMES)
def test_what_is_written_is_read_back(place: HomePlace) -> None:
    assert home(str(place)) == place


def test_the_default() -> None:
    assert DEFAULT_HOME.origin == DEFAULT_ORIGIN
    assert DEFAULT_HOME.yaw_enu_deg == 90.0


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "expected LAT,LON,ALT,YAW"),
        ("47,8,488", "expected LAT,LON,ALT,YAW"),
        ("47,8,high,0", "expected LAT,LON,ALT,YAW"),
        ("91,8,488,0", "not a latitude"),
        ("nan,8,488,0", "not a latitude"),
        ("47,8,-501,0", "not an altitude"),
        ("47,8,nan,0", "not an altitude"),
        ("47,8,488,361", "not an altitude"),
    ],
)
def test_a_bad_home_is_one_line(text: str, reason: str) -> None:
    with pytest.raises(ArgumentTypeError, match=reason):
        home(text)
