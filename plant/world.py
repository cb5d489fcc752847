"""The world: vehicle, rotors and time, advanced one frame at a time. A pure composition: (world, command) -> world."""

from dataclasses import dataclass, replace

from mavlink.frames import Quaternion, Vector, earth_from_body, normalized, quaternion_from_euler
from mavlink.hil import ActuatorCommand, StateFrame
from plant.dynamics import attitude_of, rigid_body
from plant.integrate import Integrator, solver
from plant.rotors import Rotors, RotorSpeeds
from plant.vehicle import Vehicle

State = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class World:
    """Everything that the next step depends on.

    Attributes:
        time_us: Simulated time, µs.
        state: `plant.dynamics.STATE`, 13 values.
        rotor_speeds: What the rotors turned at up to now, in the vehicle's unit.
    """

    time_us: int
    state: State
    rotor_speeds: RotorSpeeds


def world_at_rest(position_enu_m: Vector, yaw_rad: float, rotor_speed: float) -> World:
    """Return a world at time 0: level, without motion, every rotor at `rotor_speed` (the vehicle's unit)."""
    attitude: Quaternion = quaternion_from_euler(0.0, 0.0, yaw_rad)
    state = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, *position_enu_m, *attitude)
    return World(0, state, (rotor_speed, rotor_speed, rotor_speed, rotor_speed))


class Physics:
    """The laws of one vehicle: how its world goes on."""

    def __init__(self, vehicle: Vehicle, integrator: Integrator) -> None:
        """Fly `vehicle`, integrated by `integrator`."""
        self._rotors = Rotors(vehicle)
        self._integrate = solver(integrator)
        self._gravity_m_s2 = vehicle.gravity_m_s2
        self._body = vehicle.body

    def step(self, world: World, command: ActuatorCommand, duration_us: int) -> World:
        """Advance by `duration_us` with the rotors at `command`, at rest where it is not armed."""
        speeds = self._rotors.speeds(command.controls) if command.armed else (0.0, 0.0, 0.0, 0.0)
        f = rigid_body(
            self._rotors.wrench(speeds),
            mass_kg=self._body.mass_kg,
            gravity_m_s2=self._gravity_m_s2,
            inertia_kg_m2=self._body.inertia_kg_m2,
        )
        end = self._integrate(f, world.state, duration_us * 1e-6)
        state = (*end[:9], *normalized(attitude_of(end)))
        return replace(world, time_us=world.time_us + duration_us, state=state, rotor_speeds=speeds)


def state_frame(world: World) -> StateFrame:
    """Return what state feedback tells of a world."""
    u, v, w, p, q, r, x, y, z = world.state[:9]
    attitude = attitude_of(world.state)
    return StateFrame(world.time_us, (x, y, z), earth_from_body(attitude, (u, v, w)), attitude, (p, q, r))
