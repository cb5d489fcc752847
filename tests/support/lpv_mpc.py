"""The whole-vehicle law over the plant, and its model over a horizon."""

from math import pi, radians, tan

import numpy as np

from colibri.autopilot.control.interface import AttitudeDemand, Decision, VehicleState
from colibri.autopilot.control.lpv_mpc import model
from colibri.autopilot.control.lpv_mpc.law import LawMemory, LpvMpc
from colibri.autopilot.control.lpv_mpc.model import RIGID, Disturbance
from colibri.autopilot.control.lpv_mpc.mpc import model_of
from colibri.autopilot.control.parts.thrust_force import ForceLimits
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.trajectories.planner import Planner
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.common.compiled_rotations import euler_from_quaternion
from colibri.common.jit import packed
from colibri.common.rotations import nearest_turn, quaternion_from_euler
from colibri.common.types import Vector
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, World, starting_world, state_frame
from colibri.plant.vehicle.description import Vehicle, load_vehicle

VEHICLE, ROTORS = load_vehicle("hummingbird"), 4
TABLE = load_profile("flight").table("lpv-mpc")
STEP_US, INTERVAL_S = 8_000, 0.008
MODEL = model_of(VEHICLE, INTERVAL_S)
PACKED = packed(MODEL)
LAP_STEPS = 40
WIDE = ForceLimits(True, tan(1.2), 0.2, 19.0, 0.2)
CALM = Disturbance(np.zeros(3), np.zeros(3))


def circle(radius_m: float, period_s: float) -> tuple[np.ndarray, ...]:
    """Position, velocity, acceleration and yaw on a level circle, looking outwards."""
    angle = 2.0 * pi / period_s * INTERVAL_S * np.arange(LAP_STEPS + 2)
    w, out = 2.0 * pi / period_s, np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    along = np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)
    return radius_m * out, radius_m * w * along, -radius_m * w * w * out, angle


def law(vehicle: Vehicle = VEHICLE) -> LpvMpc:
    return LpvMpc(TABLE, vehicle, lambda: 0.0)


class Flight:
    def __init__(self, start: Start, vehicle: Vehicle = VEHICLE, plant: Vehicle = VEHICLE) -> None:
        self.law, self.physics = law(vehicle), Physics(plant, "rk4")
        self.world: World = starting_world(start, plant)
        self.memory: LawMemory = self.law.initial(vehicle.hover_speed)
        self.decisions: list[Decision] = []
        self.yaw_rad = radians(start.psi)
        self.off_m: Vector = (0.0, 0.0, 0.0)

    def state(self) -> VehicleState:
        frame = state_frame(self.world)
        phi, theta, psi = euler_from_quaternion(frame.attitude)
        self.yaw_rad = nearest_turn(psi, self.yaw_rad)
        euler = (phi, theta, self.yaw_rad)
        x, y, z = (true + off for true, off in zip(frame.position_enu_m, self.off_m, strict=True))
        return VehicleState((x, y, z), frame.velocity_enu_m_s, frame.attitude, euler, frame.rate_flu_rad_s)

    def take(self, memory: LawMemory, decision: Decision) -> None:
        self.memory = memory
        self.decisions.append(decision)
        controls = tuple((decision.rotor_speeds / self.law.tracker.vehicle.rotors.max_speed).tolist())
        command = ActuatorCommand(self.world.time_us, controls, armed=True)
        self.world = self.physics.step(self.world, command, STEP_US)

    def follow(self, name: str, seconds: float) -> np.ndarray:
        planner, errors = Planner(track(name), "by-formula", self.law.preview), []
        for _ in range(round(seconds * 1e6) // STEP_US):
            references = planner.horizon(self.world.time_us)
            errors.append(np.linalg.norm(references.position_enu_m[0] - self.state().position_enu_m))
            self.take(*self.law.step(self.memory, self.world.time_us, self.state(), references))
        return np.array(errors)

    def hold(self, phi: float, theta: float, thrust_n: float, seconds: float) -> None:
        n = self.law.preview.samples
        demand = AttitudeDemand(np.tile((phi, theta, 0.0), (n, 1)), np.zeros((n, 3)), np.full(n, thrust_n))
        for _ in range(round(seconds * 1e6) // STEP_US):
            self.take(*self.law.step_attitude(self.memory, self.world.time_us, self.state(), demand))


HOVERING = Start(x=0.0, y=0.0, z=20.0, psi=0.0, rotors=4740.0)
HUMMINGBIRD = load_vehicle("hummingbird").without(["battery", "ground"])
STARTS = np.array([0, 1, 3, 8])
STEPS = 8


def start(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a rigid body in mid-turn, rotor speeds and commands, the last two squared."""
    rng = np.random.default_rng(seed)
    rigid = np.concatenate(
        [
            rng.normal(size=3),
            3.0 * rng.normal(size=3),
            quaternion_from_euler(*rng.uniform(-0.8, 0.8, 3)),
            rng.uniform(-3.0, 3.0, 3),
        ]
    )
    return rigid, rng.uniform(0.2, 0.5, ROTORS), rng.uniform(0.2, 0.5, (STEPS, ROTORS))


def rolled(vehicle: Vehicle, rigid: np.ndarray, squared: np.ndarray, commands: np.ndarray) -> tuple[np.ndarray, ...]:
    motion, speeds = np.empty((STEPS + 1, RIGID)), np.empty((STEPS + 1, ROTORS))
    numbers, drive = packed(model_of(vehicle, INTERVAL_S)), model.empty_drive(STEPS, ROTORS)
    model.roll_out(rigid, squared, commands, CALM, numbers, drive, motion, speeds)
    return motion, speeds
