import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.common.earth.atmosphere import (
    METRES_PER_PASCAL,
    altitude_m,
    altitude_slope_m_pa,
    pressure_pa,
    temperature_c,
)


@pytest.mark.parametrize(
    ("height_m", "pressure", "temperature"),
    [(0.0, 101_325.0, 15.0), (1000.0, 89_874.6, 8.5), (5000.0, 54_019.9, -17.5), (11_000.0, 22_632.1, -56.5)],
)
def test_tabulated_values(height_m: float, pressure: float, temperature: float) -> None:
    assert pressure_pa(height_m) == pytest.approx(pressure, abs=0.1)
    assert temperature_c(height_m) == pytest.approx(temperature)


@given(st.floats(-500.0, 11_000.0))
def test_there_and_back(height_m: float) -> None:
    assert altitude_m(pressure_pa(height_m)) == pytest.approx(height_m, abs=1e-6)


@given(st.floats(22_700.0, 110_000.0))
def test_slope_is_the_derivative(pressure: float) -> None:
    step = 1.0
    slope = (altitude_m(pressure + step) - altitude_m(pressure - step)) / (2.0 * step)
    assert altitude_slope_m_pa(pressure) == pytest.approx(slope, rel=1e-5)


def test_where_there_is_no_air_there_is_no_pressure() -> None:
    assert pressure_pa(1e6) == 0.0
    assert altitude_m(-5.0) == altitude_m(0.0)


def test_a_pascal_is_eight_centimetres_at_sea_level() -> None:
    assert altitude_slope_m_pa(pressure_pa(0.0)) == pytest.approx(-METRES_PER_PASCAL, rel=1e-3)
