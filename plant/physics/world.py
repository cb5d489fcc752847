"""The world: vehicle, rotors, battery and time, advanced one frame at a time."""

from math import isfinite, nan

import numpy as np

from colibri.common.compiled_rotations import earth_from_body
from colibri.common.jit import packed
from colibri.common.matrices import inverse
from colibri.common.records import Record
from colibri.common.types import Array, PerRotor, Vector
from colibri.mavlink.hil.plant_status import NO_BATTERY, PlantBattery
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
from colibri.plant.environment.random_streams import Noise
from colibri.plant.environment.turbulence import CALM, Air, Eddies
from colibri.plant.environment.weather import NO_WEATHER, RecordedWind, Weather, Wind
from colibri.plant.physics.equations import PlantParameters, attitude_of, specific_force
from colibri.plant.physics.frames import OTHER_ROTORS, ROTORS, STATE, USED, VOLTAGE, WIND, frames_by, row_width
from colibri.plant.physics.integrators import Integrator
from colibri.plant.physics.start import IntegrationError, Start, check_start
from colibri.plant.vehicle.description import Vehicle

State = tuple[float, ...]

_LEVEL: State = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
_MOMENT_US = 1000


class World(Record, frozen=True):
    """The complete state of the simulation."""

    time_us: int
    state: State  # `equations.STATE`
    rotor_speeds: PerRotor  # the vehicle's unit; without lag, of the last step
    charge_used_ah: float = 0.0
    voltage_v: float = nan  # at the terminals; nan before the first step and without a battery
    wind_enu_m_s: Vector = CALM  # at the vehicle, held until the next step ends
    eddies: Eddies | None = None


def starting_world(start: Start, vehicle: Vehicle, weather: Weather = NO_WEATHER) -> World:
    check_start(start, vehicle)
    speed = vehicle.speed_from_rpm(start.rotors)
    state = (*start.velocity_flu_m_s, start.p, start.q, start.r, start.x, start.y, start.z, *start.attitude)
    wind, eddies = Air(weather).begin(start.z)
    return World(0, state, (speed,) * vehicle.rotors.count, wind_enu_m_s=wind, eddies=eddies)


class Physics:
    """Dynamics of one vehicle in one weather."""

    def __init__(
        self, vehicle: Vehicle, integrator: Integrator, weather: Weather = NO_WEATHER, noise: Noise | None = None
    ) -> None:
        self._air = Air(weather)
        self._parameters = packed(parameters_of(vehicle, self._air.steady or CALM))
        self._wind = self._parameters["wind_enu_m_s"][0]
        self._noise = noise
        self._advance = frames_by(integrator)
        self.become(vehicle)
        self._held: list[float | None] | None = None
        self._standing: PerRotor = (0.0,) * vehicle.rotors.count
        x = np.array((*_LEVEL, *self._standing, 0.0))
        self._end: tuple[World | None, Array] = (None, x)  # the last world, and its x of `equations`
        self._width = row_width(vehicle.rotors.count)
        self.rows: Array = np.empty((1, self._width))  # of `frames`, flown by the last step
        self._advance(x, self._standing, self._parameters, 0, _MOMENT_US, self.rows)

    def become(self, vehicle: Vehicle) -> None:
        """Fly another vehicle, in the same air."""
        self._parameters[:] = packed(parameters_of(vehicle, self._air.steady or CALM))
        self._as_built = self._parameters.copy()
        self._power: list[float] = self._parameters["power"][0].tolist()
        self._idle, self._top, self._battery = vehicle.rotors.idle_speed, vehicle.rotors.max_speed, vehicle.battery
        self._followed: tuple[PerRotor, PerRotor] = ((), ())  # last controls of armed rotors, and their speeds

    @property
    def is_steady(self) -> bool:
        """Whether neither air nor noise changes from step to step."""
        return self._air.steady is not None and self._noise is None

    def step(self, world: World, command: ActuatorCommand, interval_us: int, count: int = 1) -> World:
        """Advance by frames, at most `count` and one if not `is_steady`; their truth is in `rows`.

        Raises:
            IntegrationError: The state is not finite after the first one; a later one is not flown.
        """
        time_us, wind, eddies = world.time_us, self._air.steady, None
        if wind is None:
            self._wind[:] = world.wind_enu_m_s
        target = self._target(command)
        if self._noise is not None:
            target = self._disturb(self._noise, target, time_us, interval_us)
        x, rows = self._vector(world), np.empty((1 if wind is None or self._noise else count, self._width))
        flown = self._advance(x, target, self._parameters, time_us, interval_us, rows)
        if flown < len(rows):
            rows = rows[:flown]
        if not flown:
            when = f"at t = {time_us / 1e6:.3f} s"
            raise IntegrationError(f"the state left the range of the model {when}: it is not finite")
        time_us += flown * interval_us
        row = rows[-1].tolist()
        state, speeds = tuple(row[STATE:ROTORS]), row[ROTORS:VOLTAGE]
        if self._width > OTHER_ROTORS:
            speeds += row[OTHER_ROTORS:]
        if wind is None:
            velocity = earth_from_body(attitude_of(state), (state[0], state[1], state[2]))
            wind, eddies = self._air.go_on(world.eddies, time_us, state[8], velocity, interval_us)
            rows[-1, WIND:OTHER_ROTORS] = wind
        voltage_v = nan if self._battery is None else row[VOLTAGE]  # one nan: worlds without a battery can be equal
        after = World(time_us, state, tuple(speeds[: len(self._standing)]), row[USED], voltage_v, wind, eddies)
        self.rows, self._end = rows, (after, x)
        return after

    def specific_force(self, world: World) -> Vector:
        """Return the ideal accelerometer reading at the centre of mass, FLU, m/s²."""
        if self._air.steady is None:
            self._wind[:] = world.wind_enu_m_s
        force: Vector = specific_force(self._vector(world), self._parameters)
        return force

    def battery(self, world: World) -> PlantBattery:
        if self._battery is None:
            return NO_BATTERY
        power_w = 0.0
        for power, speed in zip(self._power, world.rotor_speeds, strict=True):
            power_w += power * speed * speed * speed
        voltage_v = world.voltage_v if isfinite(world.voltage_v) else self._battery.full_voltage_v
        left = max(0.0, 1.0 - world.charge_used_ah / self._battery.capacity_ah)
        return PlantBattery(voltage_v, power_w / voltage_v, world.charge_used_ah, left)

    def hold_rotor(self, rotor: int, speed: float | None) -> None:
        """Hold a rotor at a speed regardless of commands; None releases it."""
        held = self._held or [None] * len(self._standing)
        held[rotor] = speed
        self._held = held if any(it is not None for it in held) else None

    def weaken_rotor(self, rotor: int, part: float) -> None:
        """Scale a rotor's thrust, torque and power."""
        for name in ("thrust", "yaw_moment", "power"):
            self._parameters[name][0, rotor] = part * self._as_built[name][0, rotor]
        self._power = self._parameters["power"][0].tolist()

    def resist(self, times: float) -> None:
        self._parameters["resistance_ohm"] = times * self._as_built["resistance_ohm"]

    def blow(self, wind: Wind | RecordedWind) -> None:
        """Replace the mean wind; with gusts or turbulence it acts from the next step on."""
        self._air.blow(wind)
        if self._air.steady is not None:
            self._wind[:] = self._air.steady

    def carry(self, mass_kg: float) -> None:
        """Add a payload at the centre of mass; the moments of inertia stay."""
        self._parameters["mass_kg"] = self._as_built["mass_kg"] + mass_kg

    def _vector(self, world: World) -> Array:
        last, x = self._end
        return x if world is last else np.array((*world.state, *world.rotor_speeds, world.charge_used_ah))

    def _disturb(self, noise: Noise, target: PerRotor, time_us: int, duration_us: int) -> PerRotor:
        """Set the body's noise; return the commands with that of the motors."""
        self._parameters["noise_n"], self._parameters["noise_n_m"], factors = noise.over(time_us, duration_us)
        return tuple([min(max(factor * speed, 0.0), self._top) for factor, speed in zip(factors, target, strict=False)])

    def _target(self, command: ActuatorCommand) -> PerRotor:
        target = self._standing
        if command.armed:
            if command.controls != self._followed[0]:  # else repeated, as between two control samples
                idle, top, controls = self._idle, self._top, command.controls
                speeds = tuple([speed if (speed := control * top) > idle else idle for control in controls])
                self._followed = (controls, speeds)
            target = self._followed[1]
        if self._held is None:
            return target
        return tuple(free if held is None else held for free, held in zip(target, self._held, strict=True))


def parameters_of(vehicle: Vehicle, wind_enu_m_s: Vector) -> PlantParameters:
    """Convert a vehicle and the wind to the kernel's parameters."""
    rotors, arms_m = vehicle.rotors, vehicle.arms_m()
    strength = np.array(rotors.strength)
    thrust, yaw_moment = rotors.thrust_coefficient * strength, -rotors.spin() * rotors.torque_coefficient * strength
    east, north, up = wind_enu_m_s
    numbers = PlantParameters(
        mass_kg=vehicle.body.mass_kg,
        gravity_m_s2=vehicle.gravity_m_s2,
        inertia_kg_m2=vehicle.body.inertia_kg_m2,
        thrust=tuple(thrust.tolist()),
        yaw_moment=tuple(yaw_moment.tolist()),
        momentum=tuple(vehicle.rotor_momentum().tolist()),
        rotor_x_m=tuple(arms_m[:, 0].tolist()),
        rotor_y_m=tuple(arms_m[:, 1].tolist()),
        power=(0.0,) * rotors.count,
        top_speed=vehicle.rotors.max_speed,
        wind_enu_m_s=(float(east), float(north), float(up)),
    )
    if (lag := vehicle.rotors.lag) is not None:
        numbers = numbers._replace(lag_up_s=lag.time_constant_up_s, lag_down_s=lag.time_constant_down_s)
    if (drag := vehicle.drag) is not None:
        numbers = numbers._replace(
            linear_drag_n_s_m=drag.linear_n_s_m,
            quadratic_drag_n_s2_m2=drag.quadratic_n_s2_m2,
            rotor_drag=drag.rotor_coefficient,
        )
    if (ground := vehicle.ground) is not None:
        numbers = numbers._replace(
            contacts_m=vehicle.contacts_m(),
            ground_m=vehicle.ground_height_m,
            stiffness_n_m=ground.stiffness_n_m,
            damping_n_s_m=ground.damping_n_s_m,
            friction=ground.friction_coefficient,
            slip_damping_n_s_m=ground.slip_damping_n_s_m,
        )
    if (battery := vehicle.battery) is not None:
        power = np.abs(yaw_moment) * vehicle.rad_s_per_speed_unit / battery.efficiency
        numbers = numbers._replace(
            power=tuple(power.tolist()),
            full_voltage_v=battery.full_voltage_v,
            empty_voltage_v=battery.empty_voltage_v,
            resistance_ohm=battery.resistance_ohm,
            capacity_ah=battery.capacity_ah,
        )
    if not vehicle.is_flat:
        inertia = vehicle.body.inertia()
        axes = np.concatenate([rotors.axes(), arms_m[:, 2:]], axis=1)
        numbers = numbers._replace(axes=axes, inertia=np.array([inertia, inverse(inertia)]))
    return numbers


def state_frame(world: World) -> StateFrame:
    u, v, w, p, q, r, x, y, z, qw, qx, qy, qz = world.state
    attitude = (qw, qx, qy, qz)
    return StateFrame(world.time_us, (x, y, z), earth_from_body(attitude, (u, v, w)), attitude, (p, q, r))
