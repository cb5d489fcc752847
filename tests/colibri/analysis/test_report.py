"""The printed report."""

import pytest

from colibri.analysis.report import length


@pytest.mark.parametrize(
    ("metres", "printed"),
    [
        (0.0346, "0.0346 m"),
        (0.01, "0.0100 m"),
        (1.605e-3, "1.605 mm"),
        (6e-7, "0.001 mm"),
        (8.63e-9, "8.63 nm"),
        (0.0, "0.000 mm"),
    ],
)
def test_a_length_has_a_unit_in_which_it_is_not_zero(metres: float, printed: str) -> None:
    assert length(metres) == printed
