"""A nominal nonlinear MPC: one SQP step a sample, on the rotors' thrusts, its QP condensed and solved by qpsolvers.

    colibri arena race --law agile --law examples/laws/nmpc.py

Horizon, rate and weights are those of the nominal MPC of SSI-MPC (arXiv 2407.04143): 10 intervals of 0.1 s, 50 Hz. The
model has no drag, no rotor lag and no disturbance.
"""

from typing import NamedTuple

import numpy as np
from qpsolvers import solve_qp
from scipy.spatial.transform import Rotation

import colibri

NODES, INTERVAL_S = 10, 0.1
EVERY = 5  # of the references, 20 ms apart: they begin at a multiple of their interval
P, Q, V, W = slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13)  # position, quaternion wxyz, velocity, rates
WEIGHTS = np.array([0.5] * 3 + [0.1] * 4 + [0.05] * 3 + [0.01] * 3)
THRUST_WEIGHT = 1.0  # for each rotor, in parts of its largest thrust
STEP = 1e-20  # complex step: derivatives exact to the last bit


class Plan(NamedTuple):
    """States (NODES + 1, 13) and thrusts (NODES, 4) of the previous sample; no states before the first."""

    states: np.ndarray
    thrusts: np.ndarray


class Nmpc:
    control_interval_us = 20_000
    preview = colibri.Preview(interval_us=20_000, samples=(NODES - 1) * EVERY + 1)
    reads_motion = False

    def __init__(self, settings, vehicle, clock):
        self.inertia = np.array(vehicle.body.inertia_kg_m2)
        self.gravity = np.array([0.0, 0.0, vehicle.gravity_m_s2])
        self.max_speed = vehicle.rotors.max_speed
        wrench = vehicle.allocation() * self.max_speed**2 / np.array([[vehicle.body.mass_kg], *self.inertia[:, None]])
        self.wrench = wrench.T  # thrusts in parts of the largest -> specific thrust, angular acceleration
        self.hover = vehicle.gravity_m_s2 / wrench[0].sum()

    def initial(self, rotor_speed):
        return Plan(np.zeros((0, 13)), np.full((NODES, 4), self.hover))

    def rate(self, x, u):
        """Return dx/dt, (..., 13)."""
        (w, a, b, c), (p, q, r) = np.moveaxis(x[..., Q], -1, 0), np.moveaxis(x[..., W], -1, 0)
        lift, *turn = np.moveaxis(u @ self.wrench, -1, 0)
        jx, jy, jz = self.inertia
        return np.stack(
            [
                *np.moveaxis(x[..., V], -1, 0),
                *(0.5 * (-a * p - b * q - c * r), 0.5 * (w * p + b * r - c * q)),
                *(0.5 * (w * q + c * p - a * r), 0.5 * (w * r + a * q - b * p)),
                *(2.0 * (a * c + w * b) * lift, 2.0 * (b * c - w * a) * lift),
                (1.0 - 2.0 * (a * a + b * b)) * lift - self.gravity[2],
                turn[0] - (jz - jy) / jx * q * r,
                turn[1] - (jx - jz) / jy * r * p,
                turn[2] - (jy - jx) / jz * p * q,
            ],
            axis=-1,
        )

    def next(self, x, u):
        """Return the state after an interval, by Runge and Kutta's method of fourth order."""
        h = INTERVAL_S
        k1 = self.rate(x, u)
        k2 = self.rate(x + 0.5 * h * k1, u)
        k3 = self.rate(x + 0.5 * h * k2, u)
        return x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + self.rate(x + h * k3, u))

    def targets(self, references, near):
        """Return states (NODES, 13) and thrusts (NODES, 4) from the references by differential flatness."""
        p, v, a, jerk, _, yaw, yaw_rate, _ = (each[::EVERY] for each in references)
        force = a + self.gravity
        length = np.linalg.norm(force, axis=1, keepdims=True)
        z = force / length
        y = np.cross(z, np.stack([np.cos(yaw), np.sin(yaw), np.zeros(NODES)], axis=1))
        y /= np.linalg.norm(y, axis=1, keepdims=True)
        x = np.cross(y, z)
        across = jerk / length
        rates = np.stack([-(across * y).sum(1), (across * x).sum(1), yaw_rate * z[:, 2]], 1)
        turned = np.roll(Rotation.from_matrix(np.stack([x, y, z], axis=2)).as_quat(), 1, axis=1)
        for k in range(NODES):
            near = turned[k] = turned[k] if turned[k] @ near >= 0.0 else -turned[k]
        thrusts = np.repeat(self.hover * length / self.gravity[2], 4, axis=1)
        return np.hstack([p, turned, v, rates]), thrusts

    def step(self, memory, time_us, state, references):
        now = np.concatenate([state.position_enu_m, state.attitude, state.velocity_enu_m_s, state.rate_flu_rad_s])
        x = memory.states if len(memory.states) else np.tile(now, (NODES + 1, 1))
        now[Q] *= 1.0 if now[Q] @ x[0, Q] >= 0.0 else -1.0
        wanted, wanted_thrusts = self.targets(references, now[Q])
        u = memory.thrusts
        both = np.concatenate([x[:NODES], u], axis=1) + 1j * STEP * np.eye(17)[:, None]
        ahead = self.next(both[..., :13], both[..., 13:])  # (17, NODES, 13)
        slopes, missed = ahead.imag / STEP, ahead.real[0] - x[1:]
        offset = np.zeros((NODES + 1, 13))  # of the states, without a change of the thrusts
        offset[0] = now - x[0]
        effect = np.zeros((NODES + 1, 13, 4 * NODES))  # of the changes
        for k in range(NODES):
            offset[k + 1] = slopes[:13, k].T @ offset[k] + missed[k]
            effect[k + 1] = slopes[:13, k].T @ effect[k]
            effect[k + 1, :, 4 * k : 4 * k + 4] += slopes[13:, k].T
        rows = effect[:NODES].reshape(-1, 4 * NODES)
        weighted = rows * np.tile(WEIGHTS, NODES)[:, None]
        hessian = weighted.T @ rows + THRUST_WEIGHT * np.eye(4 * NODES)
        gradient = weighted.T @ (x[:NODES] + offset[:NODES] - wanted).ravel()
        gradient += THRUST_WEIGHT * (u - wanted_thrusts).ravel()
        change = solve_qp(hessian, gradient, lb=-u.ravel(), ub=1.0 - u.ravel(), solver="daqp")
        if change is None:  # a plan that has diverged: begin again
            speeds = self.max_speed * np.sqrt(u[0])
            return self.initial(None), colibri.Decision(rotor_speeds=speeds, attitude_reference=state.euler)
        thrusts = np.clip(u + change.reshape(NODES, 4), 0.0, 1.0)
        states = x + offset + effect @ change
        speeds = self.max_speed * np.sqrt(thrusts[0])
        return Plan(states, thrusts), colibri.Decision(rotor_speeds=speeds, attitude_reference=state.euler)
