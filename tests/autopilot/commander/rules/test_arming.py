"""Every check before the rotors may turn, and why it fails."""

from math import cos, nan, radians, sin

import pytest
from hypothesis import given

from colibri.autopilot.commander.rules.arming import MAX_TILT_DEG, ArmingInputs, refusals
from colibri.autopilot.control.interface import VehicleState
from colibri.common.rotations import tilt_deg
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.wire.dialect import Refusal
from tests.support.strategies import quaternions

READY = VehicleState((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
INPUTS = ArmingInputs(READY, standing=True, charge=1.0, thrust_stick=None)


def tilted(angle_deg: float) -> VehicleState:
    half = radians(0.5 * angle_deg)
    return READY._replace(attitude=(cos(half), sin(half), 0.0, 0.0), euler=(2.0 * half, 0.0, 0.0))


def moving(velocity: Vector) -> VehicleState:
    return READY._replace(velocity_enu_m_s=velocity)


FAILING = [
    (INPUTS._replace(state=None), "no telemetry"),
    (INPUTS._replace(state=tilted(46.0)), "tilted by 46 degrees, more than 45"),
    (INPUTS._replace(state=tilted(180.0)), "tilted by 180 degrees"),
    (INPUTS._replace(state=moving((0.0, -0.6, 0.0))), "moving at 0.6 m/s"),
    (INPUTS._replace(standing=False), "not on the ground"),
    (INPUTS._replace(charge=0.09), "battery low: 9%"),
    (INPUTS._replace(thrust_stick=0.7), "thrust stick is up"),
    (INPUTS._replace(battery="battery unhealthy: 0.0 V"), "battery unhealthy: 0.0 V"),
    (INPUTS._replace(outside_fence=Refusal("outside the geofence")), "outside the geofence"),
]


@pytest.mark.parametrize(("inputs", "reason"), FAILING, ids=[reason for _, reason in FAILING])
def test_a_check_that_fails_says_why(inputs: ArmingInputs, reason: str) -> None:
    (said,) = refusals(inputs)
    assert reason in said


@pytest.mark.parametrize(
    "inputs",
    [
        INPUTS,
        INPUTS._replace(state=tilted(44.0)),
        INPUTS._replace(state=moving((0.4, 0.4, -0.4))),
        INPUTS._replace(charge=0.11),
        INPUTS._replace(thrust_stick=0.59),
    ],
)
def test_less_than_that_is_no_reason(inputs: ArmingInputs) -> None:
    assert not list(refusals(inputs))


@given(quaternions())
def test_an_attitude_is_judged_by_its_tilt_whatever_its_heading(attitude: Quaternion) -> None:
    inputs = INPUTS._replace(state=READY._replace(attitude=attitude))
    assert bool(list(refusals(inputs))) is (tilt_deg(attitude) > MAX_TILT_DEG)


@pytest.mark.parametrize("attitude", [(nan, nan, nan, nan), (1.0, nan, 0.0, 0.0)])
def test_an_attitude_that_is_no_number_is_refused(attitude: Quaternion) -> None:
    assert list(refusals(INPUTS._replace(state=READY._replace(attitude=attitude))))


def test_every_reason_is_told_at_once() -> None:
    inputs = ArmingInputs(
        tilted(90.0)._replace(velocity_enu_m_s=(2.0, 0.0, 0.0)),
        False,
        0.0,
        1.0,
        Refusal("outside"),
        "no height estimate",
        "battery critical",
    )
    assert len(list(refusals(inputs))) == len(ArmingInputs.__struct_fields__) + 1  # of the state, tilt and speed
