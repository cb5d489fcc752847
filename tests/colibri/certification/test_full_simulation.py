"""The certified law in the whole plant: rotors, drag, battery and a disturbing moment, unlike the certificate's model.

The law's own code decides: with every QP failing and its observer held at nothing, so that its LQR flies all the time;
and as it flies, of which nothing is proven.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from colibri.autopilot.control.interface import AttitudeDemand, Diagnostics, VehicleState
from colibri.autopilot.control.lpv_mpc.attitude_mpc import AttitudeMpc
from colibri.autopilot.control.lpv_mpc.law import LpvMpc
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.control.qp import QpStatus
from colibri.certification import certificate as certificates
from colibri.certification.attitude import AttitudeNumbers
from colibri.certification.flights import Conditions, Plan, fly
from colibri.certification.lqr_attitude import LqrAttitude
from colibri.common.jit import packed
from colibri.common.rotations import euler_from_quaternion, quaternion_from_euler
from colibri.common.types import Array
from colibri.plant.physics.equations import attitude_of
from colibri.plant.physics.integrators import fixed_step
from colibri.plant.physics.parameters import parameters_of
from colibri.plant.vehicle.description import load_vehicle

VEHICLE = load_vehicle("hummingbird")
CERTIFICATE = Path(__file__).parent / "lpv-mpc.json"
CERTIFIED = certificates.read(CERTIFICATE, AttitudeNumbers).invariant
RESONANCE_RAD_S = 28.0
STEP_S = 0.001
SAMPLES = 125


def law() -> LpvMpc:
    """Return the law with observers that observe next to nothing, and an LQR that never ends."""
    table = load_profile("flight").table("lpv-mpc")
    observer = {**table["observer"], "max_moment_n_m": 1e-12, "max_acceleration_m_s2": 1e-12}
    fallback = {**table["fallback"], "lqr_samples": 1000}
    return LpvMpc({**table, "observer": observer, "fallback": fallback}, VEHICLE, lambda: 0.0)


def disturbances(kind: int, rng: np.random.Generator) -> Callable[[int, Array], Array]:
    """Return the moment, N m, of a sample and its errors: constant, random, at the loop's resonance, or raising V most.

    All but the swinging one are as long as is allowed.
    """
    numbers, P = CERTIFIED.numbers, CERTIFIED.proof.P

    def along(vector: Array) -> Array:
        moment_n_m: Array = numbers.disturbance_n_m * vector / np.linalg.norm(vector)
        return moment_n_m

    constant = along(rng.normal(size=3))
    return (
        lambda _sample, _z: constant,
        lambda _sample, _z: along(rng.normal(size=3)),
        lambda sample, _z: constant * np.sin(RESONANCE_RAD_S * numbers.interval_s * sample),
        lambda _sample, z: along(z @ P[:, [1, 3, 5]] / numbers.inertia_kg_m2),
    )[kind]


def values(controller: LpvMpc, start: Array, disturbance: Callable[[int, Array], Array]) -> list[float]:
    """Return V at each sample of a flight that holds a level attitude, disturbed by what `disturbances` returns."""
    parameters = packed(parameters_of(VEHICLE, (0.0, 0.0, 0.0)))
    inertia = np.array(VEHICLE.body.inertia_kg_m2)
    allocation, hover_n = VEHICLE.allocation(), VEHICLE.body.mass_kg * VEHICLE.gravity_m_s2
    squared = np.linalg.solve(allocation, [hover_n, *start[6:9]])
    x = np.zeros(18)
    x[3:6], x[8] = start[[1, 3, 5]], 100.0
    x[9:13] = quaternion_from_euler(start[0], start[2], start[4])
    x[13:17] = np.sqrt(squared)
    memory = controller.initial(VEHICLE.hover_speed)
    wrench = np.array([hover_n, *start[6:9]])
    speeds = np.sqrt(squared) / VEHICLE.rotors.max_speed
    tracked = memory.tracked._replace(speeds=speeds, wrench=wrench, mean_wrench=wrench)
    memory = memory._replace(tracked=tracked, moments=start[9:].copy())
    count = controller.preview.samples
    demand = AttitudeDemand(np.zeros((count, 3)), np.zeros((count, 3)), np.full(count, hover_n))
    found = []
    for sample in range(SAMPLES):
        euler = euler_from_quaternion(attitude_of(x.tolist()))
        p, q, r = x[3:6].tolist()
        z = np.array([euler[0], p, euler[1], q, euler[2], r, *memory.tracked.wrench[1:], *memory.moments])
        found.append(float(z @ CERTIFIED.proof.P @ z))
        moment_n_m = disturbance(sample, z)
        u, v, w = x[:3].tolist()
        state = VehicleState((0.0, 0.0, 100.0), (u, v, w), attitude_of(x.tolist()), euler, (p, q, r))
        memory, decision = controller.step_attitude(memory, sample * 8000, state, demand)
        for _ in range(round(CERTIFIED.numbers.interval_s / STEP_S)):
            x, _ = fixed_step(x, tuple(decision.rotor_speeds.tolist()), parameters, STEP_S)
            x[3:6] += STEP_S * moment_n_m / inertia
    return found


def largest_value(controller: LpvMpc, flights: int) -> float:
    """Return the largest V after the start of flights from the set's border."""
    rng, largest = np.random.default_rng(4), 0.0
    certified = LqrAttitude(load_profile("flight").table("lpv-mpc"), VEHICLE, Conditions(0.01, 0.5))
    for i, start in enumerate(fly(certified, CERTIFIED, Plan(flights, 0.0, seed=4)).states[0]):
        began, *later = values(controller, start, disturbances(i % 4, rng))
        assert began == pytest.approx(1.0)
        largest = max(largest, *later)
    return largest


FLIGHTS = pytest.mark.parametrize("flights", [40, pytest.param(1000, marks=pytest.mark.long)])


@FLIGHTS
def test_flights_of_the_whole_plant_stay_in_the_set(flights: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(AttitudeMpc, "plan", lambda *_: (None, Diagnostics(QpStatus.INFEASIBLE)))
    assert largest_value(law(), flights) <= 1.0


@FLIGHTS
def test_so_do_those_of_the_law_as_it_flies(flights: int) -> None:
    controller = LpvMpc(load_profile("flight").table("lpv-mpc"), VEHICLE, lambda: 0.0)
    assert largest_value(controller, flights) <= 1.0
