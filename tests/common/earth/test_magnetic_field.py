"""The magnetic field: the World Magnetic Model's own test values, and what compasses show."""

from math import hypot

import pytest

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic
from colibri.common.earth.magnetic_field import field_enu_gauss


@pytest.mark.parametrize(
    ("place", "north_nt", "east_nt", "down_nt"),
    [
        (Geodetic(80.0, 0.0, 0.0), 6521.6, 145.9, 54791.5),
        (Geodetic(0.0, 120.0, 0.0), 39677.8, -109.6, -10580.2),
        (Geodetic(-80.0, 240.0, 0.0), 6117.5, 15751.9, -52022.5),
        (Geodetic(80.0, 0.0, 100e3), 6216.0, 92.4, 52598.8),
    ],
)
def test_published_test_values(place: Geodetic, north_nt: float, east_nt: float, down_nt: float) -> None:
    """Of the model's own WMM2025_TEST_VALUES.txt, year 2025.0."""
    field = field_enu_gauss(place, 2025.0)
    assert field == pytest.approx((east_nt * 1e-5, north_nt * 1e-5, -down_nt * 1e-5), abs=1e-6)


@pytest.mark.parametrize("altitude_m", [-5e3, 1e9])
def test_beyond_its_altitudes_the_model_holds(altitude_m: float) -> None:
    assert all(abs(axis) < 1.0 for axis in field_enu_gauss(DEFAULT_ORIGIN._replace(altitude_m=altitude_m)))


@pytest.mark.parametrize("place", [Geodetic(90.0, 0.0, 0.0), Geodetic(-90.0, 12.0, 0.0), Geodetic(0.0, 180.0, 0.0)])
def test_at_the_edges_of_the_map_it_is_finite(place: Geodetic) -> None:
    assert 0.2 < hypot(*field_enu_gauss(place)) < 0.7
