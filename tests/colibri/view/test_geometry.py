from math import nan, pi

import numpy as np
import pytest

from colibri.view.geometry import (
    about_up,
    arrow,
    blade_angles,
    bounds,
    circle,
    ground_point,
    outline,
    rotor_colour,
    segments,
    thinned,
    thrust_arrows,
    zone_segments,
)
from colibri.view.snapshot import Mark, Surroundings, VehicleShape, Zone


def test_a_faster_rotor_is_redder_and_an_unknown_one_is_grey() -> None:
    slow, fast = rotor_colour(0.1), rotor_colour(1.0)
    assert slow[2] > slow[0]
    assert fast[0] > fast[2]
    red, green, blue = rotor_colour(nan)
    assert red == green == blue


def test_thrust_goes_with_the_square_of_the_speed() -> None:
    arrows = thrust_arrows(VehicleShape(), (0.5, 1.0, 0.0, nan), scale=2.0)
    lengths = np.linalg.norm(arrows[:, 1] - arrows[:, 0], axis=1)
    assert lengths[1] == pytest.approx(4.0 * lengths[0])
    assert lengths[2:] == pytest.approx([0.0, 0.0], abs=1e-5)


def test_rotors_turn_their_own_way() -> None:
    turned = blade_angles((1.0, 0.5, 0.0, nan), (1.0, -1.0, 1.0, 1.0), (0.0, 0.0, 0.0, 0.0), 0.1)
    assert 0.0 < turned[0] < pi < turned[1]
    assert turned[2:] == (0.0, 0.0)
    assert np.linalg.norm(about_up(turned[0])) == pytest.approx(1.0)


def test_points_that_are_not_numbers_part_a_line() -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [nan, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    assert segments(points).tolist() == [[[0, 0, 0], [1, 0, 0]], [[2, 0, 0], [3, 0, 0]]]
    assert len(segments(points[:1])) == len(segments(points[:0])) == 0


@pytest.mark.parametrize("count", [0, 1, 7, 100, 101])
def test_thinned_points_keep_the_last(count: int) -> None:
    points = np.arange(3.0 * count).reshape(count, 3)
    kept = thinned(points, 10)
    assert len(kept) <= 11
    assert kept[-1:].tolist() == points[-1:].tolist()


@pytest.mark.parametrize("corners", [np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]]), circle(1.0, 2.0, 5.0)])
def test_a_zone_is_closed_below_and_above(corners: np.ndarray) -> None:
    lines = zone_segments(Zone(corners, keeps_in=True), -1.0, 6.0)
    assert {-1.0, 6.0} == set(np.unique(lines[:, :, 2]).tolist())
    upright = lines[np.abs(lines[:, 1, 2] - lines[:, 0, 2]) > 0.0]
    assert len(upright) == min(len(corners), 4)
    assert len(lines) == 2 * len(corners) + len(upright)


def test_a_click_meets_the_ground_or_the_sky() -> None:
    assert ground_point((0.0, 0.0, 10.0), (1.0, 0.0, -2.0), 2.0) == pytest.approx((4.0, 0.0, 2.0))
    assert ground_point((0.0, 0.0, 10.0), (1.0, 0.0, 0.1), 0.0) is None


def test_the_scene_fits_what_is_known() -> None:
    middle, extent_m = bounds([np.array([[0.0, 0.0, 0.0], [nan, 0.0, 0.0]]), np.array([[10.0, 4.0, 2.0]])])
    assert middle == (5.0, 2.0, 1.0)
    assert extent_m == 5.0
    assert bounds([np.empty((0, 3))])[1] == 2.0


def test_calm_air_has_no_arrow() -> None:
    assert arrow((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 1.0) is None
    assert arrow((0.0, 0.0, 1.0), (nan, nan, nan), 1.0) is None
    blown = arrow((0.0, 0.0, 1.0), (3.0, 0.0, 0.0), 1.0)
    assert blown is not None
    assert blown.shape == (1, 2, 3)


def test_plans_home_and_paths_have_to_be_in_sight() -> None:
    corners = np.array([[-6.0, -6.0], [12.0, -6.0], [12.0, 10.0]])
    around = Surroundings(
        ground_m=1.0,
        path=np.array([[0.0, 0.0, 9.0]]),
        home_enu_m=(0.0, 0.0, 1.0),
        mission=(Mark((20.0, 0.0, 3.0), "1"),),
        rally=(Mark((0.0, -30.0, 3.0), "rally 1"),),
        fence=(Zone(corners, keeps_in=True),),
    )
    assert bounds(outline(around)) == ((7.0, -10.0, 5.0), 20.0)
    assert bounds(outline(Surroundings())) == ((0.0, 0.0, 1.0), 2.0)
