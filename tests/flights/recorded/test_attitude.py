"""Attitude and body rates demanded of profile `flight`: hover, then what a client or a pilot demands.

Plant and control law in one process, the state through the codec, with rotor lag, drag and battery.
"""

from collections.abc import Callable
from math import nan, radians
from typing import Any

import numpy as np
import pytest

from colibri.autopilot.control.interface import AttitudeController, VehicleState
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.control.registry import load_controller
from colibri.autopilot.guidance.attitude_reference import (
    AttitudeReference,
    attitude_command,
    rate_command,
    tilt_command,
)
from colibri.autopilot.guidance.attitude_slew import AttitudeCommand
from colibri.common.rotations import euler_from_quaternion, nearest_turn, quaternion_from_euler
from colibri.common.types import Array
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame, decode_state, encode_state
from colibri.mavlink.wire.dialect import PLANT_COMPONENT, Codec
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, World, starting_world, state_frame
from colibri.plant.vehicle.description import load_vehicle

VEHICLE = load_vehicle("hummingbird")
PROFILE = load_profile("flight")
HOVER = Start(z=100.0, rotors=VEHICLE.hover_speed * 30.0 / np.pi)
WEIGHT_N = VEHICLE.body.mass_kg * VEHICLE.gravity_m_s2
FRAME_US = 4_000
T, PHI, THETA, PSI, Z, FALLBACK = range(6)


def received(world: World, codec: Codec) -> StateFrame:
    attitude, position = codec.decode(b"".join(encode_state(codec, state_frame(world))))
    frame = decode_state(attitude, position)
    assert frame is not None
    return frame


def fly(
    wish_at: Callable[[float], AttitudeCommand], duration_s: float, start: Start = HOVER, law: str = "lpv-mpc"
) -> Array:
    """Fly what is demanded at each time, s; return time, phi, theta, psi (degrees), height, fallback a sample."""
    controller: Any = load_controller(law)(PROFILE.table(law), VEHICLE, lambda: 0.0)
    assert isinstance(controller, AttitudeController)
    generator = AttitudeReference(VEHICLE, controller.preview)
    physics, codec = Physics(VEHICLE, "rk4"), Codec(1, PLANT_COMPONENT)
    world, memory, reference = starting_world(start, VEHICLE), controller.initial(VEHICLE.hover_speed), None
    yaw, rows = 0.0, []
    while world.time_us < duration_s * 1e6:
        frame = received(world, codec)
        phi, theta, psi = euler_from_quaternion(frame.attitude)
        yaw = nearest_turn(psi, yaw)
        state = VehicleState(
            frame.position_enu_m, frame.velocity_enu_m_s, frame.attitude, (phi, theta, yaw), frame.rate_flu_rad_s
        )
        reference, demand = generator.step(reference or generator.initial(state), state, wish_at(world.time_us * 1e-6))
        memory, decision = controller.step_attitude(memory, world.time_us, state, demand)
        c1, c2, c3, c4 = (decision.rotor_speeds / VEHICLE.rotors.max_speed).tolist()
        rows.append((world.time_us * 1e-6, phi, theta, yaw, frame.position_enu_m[2], decision.diagnostics.fallback))
        for _ in range(controller.control_interval_us // FRAME_US):
            world = physics.step(world, ActuatorCommand(world.time_us, (c1, c2, c3, c4), armed=True), FRAME_US)
    flown = np.array([(*row[:5], row[5] is not None) for row in rows])
    flown[:, PHI : PSI + 1] = np.degrees(flown[:, PHI : PSI + 1])
    return flown


def after(flown: Array, time_s: float) -> Array:
    return flown[flown[:, T] >= time_s - 1e-9]


@pytest.mark.parametrize("law", ["lpv-mpc", "geometric-se3"])
def test_a_roll_step_is_followed(law: str) -> None:
    """20 degrees: within one from 0.6 s on, no more than half a degree too far, the other angles still."""
    flown = fly(lambda t: tilt_command(radians(20.0) if t >= 0.5 else 0.0, 0.0, 0.0, WEIGHT_N), 2.5, law=law)
    assert np.abs(flown[flown[:, T] < 0.5][:, PHI]).max() < 0.1
    assert np.abs(after(flown, 1.1)[:, PHI] - 20.0).max() < 1.0
    assert np.abs(after(flown, 2.0)[:, PHI] - 20.0).max() < 0.1
    assert flown[:, PHI].max() < 20.5
    assert np.abs(flown[:, THETA]).max() < 1.0
    assert not flown[:, FALLBACK].any()


@pytest.mark.parametrize("axis", [PHI, THETA, PSI])
def test_a_body_rate_turns_by_its_integral(axis: int) -> None:
    """30 degrees a second for a second: 30 degrees, and there it stays."""
    rate = [0.0, 0.0, 0.0]
    rate[axis - PHI] = radians(30.0)
    p, q, r = rate
    flown = fly(lambda t: rate_command((p, q, r) if t < 1.0 else (0.0, 0.0, 0.0), WEIGHT_N), 3.0)
    assert np.abs(after(flown, 1.6)[:, axis] - 30.0).max() < 2.0
    assert np.abs(after(flown, 2.5)[:, axis] - 30.0).max() < 0.2
    others = [other for other in (PHI, THETA, PSI) if other != axis]
    assert np.abs(flown[:, others]).max() < 0.5
    assert not flown[:, FALLBACK].any()


def test_a_pose_is_flown_to_across_the_compass() -> None:
    attitude = quaternion_from_euler(radians(15.0), radians(-10.0), radians(-160.0))
    flown = fly(lambda t: attitude_command(attitude, nan) if t >= 0.2 else tilt_command(0.0, 0.0, 0.0, nan), 5.0)
    assert after(flown, 4.5)[:, PHI : PSI + 1] == pytest.approx(
        np.broadcast_to([15.0, -10.0, -160.0], after(flown, 4.5)[:, PHI : PSI + 1].shape), abs=0.5
    )
    assert not flown[:, FALLBACK].any()


def test_full_sticks_back_and_forth_are_followed() -> None:
    def sticks(t: float) -> AttitudeCommand:
        return tilt_command(
            radians(35.0 * (-1) ** int(t)), radians(35.0 * (-1) ** int(1.3 * t)), 1.7 * (-1) ** int(0.5 * t), nan
        )

    flown = fly(sticks, 8.0)
    tilt = np.cos(np.radians(flown[:, PHI])) * np.cos(np.radians(flown[:, THETA]))
    assert tilt.min() > np.cos(np.radians(52.0))
    assert not flown[:, FALLBACK].any()


def test_the_weight_is_carried_whatever_the_tilt() -> None:
    flown = fly(lambda t: tilt_command(radians(30.0) if t >= 0.5 else 0.0, 0.0, 0.0, nan), 2.0)
    assert np.abs(flown[:, Z] - 100.0).max() < 0.5


@pytest.mark.parametrize(
    ("start", "recovers"),
    [({"phi": 170.0}, True), ({"theta": 85.0}, False), ({"phi": 120.0, "p": 6.0, "q": -6.0, "r": 5.0}, False)],
)
def test_it_comes_back_under_an_attitude_demand_too(start: dict[str, float], recovers: bool) -> None:
    """Nearer than upside down the demand begins within reach, so that the MPC flies from the first sample on."""
    flown = fly(lambda _: tilt_command(0.0, 0.0, 0.0, nan), 3.0, HOVER._replace(**start))
    assert flown[0, FALLBACK] == recovers
    assert not after(flown, 1.0)[:, FALLBACK].any()
    assert np.abs(after(flown, 2.0)[:, (PHI, THETA)]).max() < 1.0
