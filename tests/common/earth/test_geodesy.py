from math import cos, inf, nan, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.common.earth import compiled_geodesy
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, EARTH_RADIUS_M, Geodetic, enu_of, geodetic_of, is_on_earth
from tests.support.strategies import reals

ORIGINS = st.builds(Geodetic, st.floats(-89.0, 89.0), reals(180.0), reals(5000.0))
DEGREE_M = radians(1.0) * EARTH_RADIUS_M


@given(ORIGINS, st.tuples(reals(1e5), reals(1e5), reals(1e4)))
def test_there_and_back_again(origin: Geodetic, place: tuple[float, float, float]) -> None:
    there = geodetic_of(place, origin)
    assert is_on_earth(there.latitude_deg, there.longitude_deg)
    assert enu_of(there, origin) == pytest.approx(place, abs=1e-6)


@given(ORIGINS, st.tuples(reals(1e5), reals(1e5), reals(1e4)))
def test_compiled_they_give_the_same_bits(origin: Geodetic, place: tuple[float, float, float]) -> None:
    there = geodetic_of(place, origin)
    assert compiled_geodesy.geodetic_of(place, origin) == there
    assert compiled_geodesy.enu_of(there, origin) == enu_of(there, origin)


def test_a_degree_north_and_a_degree_east() -> None:
    latitude, longitude, altitude = DEFAULT_ORIGIN
    east, north, up = enu_of(Geodetic(latitude + 1.0, longitude, altitude + 7.0), DEFAULT_ORIGIN)
    assert (east, north, up) == pytest.approx((0.0, DEGREE_M, 7.0), abs=1e-6)
    east, north, _ = enu_of(Geodetic(latitude, longitude + 0.01, altitude), DEFAULT_ORIGIN)
    assert east == pytest.approx(0.01 * DEGREE_M * cos(radians(latitude)), rel=1e-6)
    assert abs(north) < 0.1


def test_across_the_date_line() -> None:
    origin = Geodetic(10.0, 179.9999, 0.0)
    there = geodetic_of((100.0, 0.0, 0.0), origin)
    assert -180.0 <= there.longitude_deg < -179.9
    assert enu_of(there, origin) == pytest.approx((100.0, 0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("place", [(90.1, 0.0), (0.0, -180.1), (nan, 0.0), (0.0, nan), (inf, 0.0), (0.0, -inf)])
def test_what_is_on_earth(place: tuple[float, float]) -> None:
    assert is_on_earth(90.0, 180.0)
    assert is_on_earth(-90.0, -180.0)
    assert not is_on_earth(*place)
