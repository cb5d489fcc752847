"""The certified law in the whole plant: rotors, drag, battery and a disturbing moment, unlike the certificate's model.

The law's own code decides, as it flies.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colibri.autopilot.control.interface import AttitudeController, AttitudeDemand, VehicleState
from colibri.autopilot.control.lpv_mpc import law as lpv_mpc
from colibri.autopilot.control.lpv_mpc.mpc import Plan as QpPlan
from colibri.autopilot.control.parts.vehicle_tracking import Tracked
from colibri.autopilot.control.profile import load_profile
from colibri.certification import certificate as certificates
from colibri.certification.attitude import CertifiedConditions
from colibri.certification.planned_attitude import PlannedAttitude
from colibri.certification.report import fly
from colibri.common.jit import packed
from colibri.common.rotations import euler_from_quaternion
from colibri.common.types import Array, Quaternion
from colibri.plant.physics.equations import attitude_of
from colibri.plant.physics.integrators import fixed_step
from colibri.plant.physics.world import parameters_of
from colibri.plant.vehicle.description import load_vehicle
from tests.support.certificates import read_certificate

VEHICLE, CONDITIONS = load_vehicle("hummingbird"), CertifiedConditions(0.01, 0.5)
HOVER_N = VEHICLE.body.mass_kg * VEHICLE.gravity_m_s2
ALLOCATION = VEHICLE.allocation() * VEHICLE.rotors.max_speed**2
RESONANCE_RAD_S = 28.0
STEP_S = 0.001
SAMPLES = 125


def table(name: str) -> dict[str, Any]:
    return load_profile("flight").table(name)


NAME = "lpv-mpc"
CERTIFIED = PlannedAttitude(table(NAME), VEHICLE, CONDITIONS)


def errors_of(attitude: Quaternion) -> Array:
    errors: Array = 2.0 * np.copysign(1.0, attitude[0]) * np.array(attitude[1:])
    return errors


def memory_of(tracked: Tracked, remembered: Array) -> lpv_mpc.LawMemory:
    commands, level = (np.linalg.solve(ALLOCATION, [HOVER_N, *moments]) for moments in (remembered, np.zeros(3)))
    states = np.tile(np.concatenate([np.zeros(12), level]), (29, 1))
    return lpv_mpc.LawMemory(tracked, QpPlan(np.tile(commands, (28, 1)), states), 1, 0)


def remembered(memory: lpv_mpc.LawMemory) -> Array:
    assert memory.plan
    moments: Array = ALLOCATION[1:] @ memory.plan.commands[memory.age]
    return moments


def invariant() -> certificates.ProofEntry:
    return read_certificate(Path(__file__).parent / f"{NAME}.json").invariant


def disturbances(entry: certificates.ProofEntry, kind: int, rng: np.random.Generator) -> Callable[[int, Array], Array]:
    """Return the moment, N m, of a sample and its errors: constant, random, at the loop's resonance, or raising V most.

    All but the swinging one are as long as is allowed.
    """
    numbers, P = entry.numbers, entry.proof.P

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


def values(
    entry: certificates.ProofEntry,
    controller: AttitudeController[Any],
    start: Array,
    disturbance: Callable[[int, Array], Array],
) -> list[float]:
    """Return V at each sample of a flight that holds a level attitude, disturbed by what `disturbances` returns."""
    parameters = packed(parameters_of(VEHICLE, (0.0, 0.0, 0.0)))
    inertia, wrench = np.array(VEHICLE.body.inertia_kg_m2), np.array([HOVER_N, *start[6:9]])
    speeds = np.sqrt(np.linalg.solve(ALLOCATION, wrench))
    x = np.zeros(18)
    x[3:6], x[8] = start[[1, 3, 5]], 100.0
    x[10:13] = 0.5 * start[[0, 2, 4]]
    x[9] = np.sqrt(1.0 - (x[10:13] ** 2).sum())
    x[13:17] = speeds * VEHICLE.rotors.max_speed
    tracked = controller.initial(VEHICLE.hover_speed).tracked
    memory = memory_of(tracked._replace(rotors=np.stack([speeds, speeds, wrench, wrench])), start[9:].copy())
    count = controller.preview.samples
    demand = AttitudeDemand(np.zeros((count, 3)), np.zeros((count, 3)), np.full(count, HOVER_N))
    found = []
    for sample in range(SAMPLES):
        attitude, (p, q, r) = attitude_of(x.tolist()), x[3:6].tolist()
        z = np.zeros(12)
        z[[0, 2, 4]], z[[1, 3, 5]] = errors_of(attitude), (p, q, r)
        z[6:9], z[9:] = memory.tracked.rotors[2, 1:], remembered(memory)
        found.append(float(z @ entry.proof.P @ z))
        moment_n_m = disturbance(sample, z)
        u, v, w = x[:3].tolist()
        state = VehicleState((0.0, 0.0, 100.0), (u, v, w), attitude, euler_from_quaternion(attitude), (p, q, r))
        memory, decision = controller.step_attitude(memory, sample * 8000, state, demand)
        for _ in range(round(entry.numbers.interval_s / STEP_S)):
            fixed_step(x, tuple(decision.rotor_speeds.tolist()), parameters, STEP_S, x)
            x[3:6] += STEP_S * moment_n_m / inertia
    return found


@pytest.mark.parametrize("flights", [40, pytest.param(1000, marks=pytest.mark.long)])
def test_flights_of_the_law_as_it_flies_stay_in_the_set(flights: int) -> None:
    rng, entry = np.random.default_rng(4), invariant()
    law = lpv_mpc.LpvMpc(table(NAME), VEHICLE, lambda: 0.0)
    for i, start in enumerate(fly(CERTIFIED, entry, flights, 0.0, seed=4).states[0]):
        began, *later = values(entry, law, start, disturbances(entry, i % 4, rng))
        assert began == pytest.approx(1.0)
        assert max(later) <= 1.0
