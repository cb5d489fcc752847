"""A control loop over the plant, with restarts and attitude demands, and their checks."""

from collections.abc import Iterator
from math import acos, degrees
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from colibri.analysis.lost import LOST_M
from colibri.autopilot.control.interface import AttitudeDemand, Controller, VehicleState
from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.control.registry import BuildError, in_words
from colibri.autopilot.guidance.trajectories.planner import Planner
from colibri.autopilot.parameters.number_paths import changed, described, paths, read
from colibri.common.errors import Error
from colibri.common.rotations import rotation_matrix
from colibri.common.types import Array
from colibri.conformance.interface_checks import out_of_limits
from colibri.conformance.step_records import FlownStep, fly_for_steps
from colibri.conformance.subject import Row, Subject, judged, not_applicable
from colibri.flights.plan import FlightPlan
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.parameters.numbers import Number
from colibri.plant.physics.world import Physics, World, starting_world, state_frame


class LoopFlight:
    def __init__(self, subject: Subject, plan: FlightPlan) -> None:
        self._subject, self._plan = subject, plan
        self._physics = Physics(plan.plant_vehicle, "rk4")
        self.world: World = starting_world(plan.start, plan.plant_vehicle)
        self.loop = self.new_loop()
        self._planner = Planner(plan.track, plan.profile.references, self.loop.preview)
        self.loop.begin(self._subject.vehicle.hover_speed, plan.start_yaw_rad)

    def new_loop(self) -> ControlLoop:
        return ControlLoop(self._subject.profile, self._subject.vehicle, perf_counter, self._subject.law)

    def fly(self, seconds: float) -> Array:
        """Follow the track; return the distance to it at each sample, m."""
        off_m = []
        for _ in range(self._samples(seconds)):
            state = self.loop.observe(state_frame(self.world))
            references = self._planner.horizon_at(self.world.time_us, self.loop.control_interval_us)
            off_m.append(np.linalg.norm(references.position_enu_m[0] - state.position_enu_m))
            self.loop.decide(self.world.time_us, state, references)
            self._go_on()
        return np.array(off_m)

    def hold(self, angles: tuple[float, float, float], thrust_n: float) -> VehicleState:
        n = self.loop.preview.samples
        demand = AttitudeDemand(np.tile(angles, (n, 1)), np.zeros((n, 3)), np.full(n, thrust_n))
        for _ in range(self._samples(HELD_S)):
            state = self.loop.observe(state_frame(self.world))
            self.loop.decide_attitude(self.world.time_us, state, demand)
            self._go_on()
        return self.loop.observe(state_frame(self.world))

    @property
    def tilt_deg(self) -> float:
        return degrees(acos(min(max(rotation_matrix(state_frame(self.world).attitude)[2][2], -1.0), 1.0)))

    def _samples(self, seconds: float) -> int:
        return round(seconds * 1e6) // self.loop.control_interval_us

    def _go_on(self) -> None:
        command = ActuatorCommand(self.world.time_us, self.loop.controls, armed=True)
        self.world = self._physics.step(self.world, command, self.loop.control_interval_us)


class Restarted(NamedTuple):
    """A flight with a restart in its middle.

    Attributes:
        unbroken_m, off_m: Distance to the reference afterwards, (n,), without and with it.
    """

    unbroken_m: Array
    off_m: Array
    tilt_deg: float
    same: bool  # both flights are identical, bit for bit
    is_plain: bool  # the law's memory was kept


_BEFORE_S, _AFTER_S, HELD_S = 1.0, 3.0, 1.5  # durations around a restart, and of a held attitude
HOW = ("seamless", "anew", "blind")


def restarted(
    track: str, *, how: str, controller: Any, profile: Any = None, vehicle: Any = None, seed: int = 0, **options: Any
) -> Restarted:
    """Fly on with a new control loop: `seamless` from a recent checkpoint, `anew` from charge and mass, or `blind`."""
    subject = Subject.of(controller, profile, vehicle, seed)
    return restart(subject, how, subject.plan(track, **options))


def restart(subject: Subject, how: str, plan: FlightPlan) -> Restarted:
    flight = LoopFlight(subject, plan)
    flight.fly(_BEFORE_S)
    kept, yaw_rad, world = flight.loop.record(), flight.loop.observe(state_frame(flight.world)).euler[2], flight.world
    unbroken_m, unbroken = flight.fly(_AFTER_S), flight.world
    flight.loop, flight.world = flight.new_loop(), world
    if how == "blind":
        flight.loop.begin_in_flight(yaw_rad)
    else:
        flight.loop.resume(kept, seamless=how == "seamless")
    off_m = flight.fly(_AFTER_S)
    return Restarted(unbroken_m, off_m, flight.tilt_deg, flight.world.state == unbroken.state, bool(kept.memory))


def held(
    phi: float, theta: float, *, thrust_n: float, controller: Any, profile: Any = None, vehicle: Any = None
) -> VehicleState:
    """Hold roll and pitch, rad, and a thrust, N, for 1.5 s from hover; return the final state."""
    return hold(Subject.of(controller, profile, vehicle, 0), phi, theta, thrust_n)


def hold(subject: Subject, phi: float, theta: float, thrust_n: float) -> VehicleState:
    flight = LoopFlight(subject, subject.plan("hover:height=60", start=subject.start(z=60.0)))
    yaw_rad = flight.loop.observe(state_frame(flight.world)).euler[2]
    return flight.hold((phi, theta, yaw_rad), thrust_n)


_MASS = "body.mass_kg"
_BY, _NUMBERS = 1.05, 16


class Rebuilt(NamedTuple):
    """A law with one changed number, unless it refused, changed its interval, or raised."""

    key: str
    value: float
    law: Controller[Any] | None
    raised: str


def rebuilt(key: str, value: float, *, controller: Any, profile: Any = None, vehicle: Any = None) -> Controller[Any]:
    """Build a law with one other number, in its table or `body.mass_kg`."""
    return _build(Subject.of(controller, profile, vehicle, 0), key, value)


def rebuilds(subject: Subject) -> Iterator[Rebuilt]:
    """Yield laws with another mass, and with up to 16 numbers, each 5 % higher."""
    table = subject.profile.table(subject.name)
    found = [path for path in paths(table) if isinstance(read(table, path), float)]
    every = -(-len(found) // _NUMBERS) or 1
    yield _rebuilt(subject, _MASS, _BY * subject.vehicle.body.mass_kg)
    for path in found[::every]:
        yield _rebuilt(subject, described(path), _BY * read(table, path))


def _rebuilt(subject: Subject, key: str, value: float) -> Rebuilt:
    now = subject.build()
    try:
        law = _build(subject, key, value)
    except BuildError as error:
        return Rebuilt(key, value, None, str(error))
    except Error:
        return Rebuilt(key, value, None, "")
    same = (law.control_interval_us, law.preview) == (now.control_interval_us, now.preview)
    return Rebuilt(key, value, law if same else None, "")


def _build(subject: Subject, key: str, value: float) -> Controller[Any]:
    if key == _MASS:
        return subject.build(vehicle=subject.vehicle.replace(key, value))
    table = subject.profile.table(subject.name)
    path = next(path for path in paths(table) if described(path) == key)
    other = changed(table, [Number("number", path)], {"number": value}, {"number": read(table, path)})
    return subject.build(subject.profile.replace(f"controllers.{subject.name}", other))


_TRACK = "circle:speed=1"
_ON_IT = {"x": 2.0, "psi": 90.0, "vy": 1.0}
_MAX_TILT_DEG = 45.0
_STEPS = 3  # steps with each changed number
_TRIED = {
    "seamless": "from its checkpoint, the same flight bit for bit",
    "anew": "restarted in flight, charge and mass kept",
    "blind": "restarted in flight, without a record",
}


def restart_checks(subject: Subject) -> Iterator[Row]:
    plan = subject.plan(_TRACK, start=subject.start(**_ON_IT))
    for how in HOW:
        failure, found = "", ""
        try:
            flown = restart(subject, how, plan)
        except Exception as error:
            failure = in_words(error)
        else:
            if how == "seamless" and not flown.is_plain:
                yield not_applicable(_TRIED[how], "its memory is not plain data")
                continue
            found = f"at most {flown.off_m.max():.2g} m off (unbroken {flown.unbroken_m.max():.2g} m)"
            if how == "seamless" and not flown.same:
                failure = f"another flight, {found}: is its memory always of the type that initial returns?"
            elif flown.off_m.max() > LOST_M or flown.tilt_deg > _MAX_TILT_DEG:
                failure = f"{found}, tilted {flown.tilt_deg:.0f}° at its end"
        code = f"print(restarted({subject.call(_TRACK, how=how, start=subject.start(**_ON_IT))}))"
        yield judged(_TRIED[how], failure, found, subject.script(code, "restarted"))
    yield _handed_over(subject)


def _handed_over(subject: Subject) -> Row:
    tried = "built from other numbers, handed the old memory"
    options = {"start": subject.start(**_ON_IT), "duration": max(0.3, 6e-6 * subject.build().control_interval_us)}
    steps = fly_for_steps(subject, _TRACK, **options).steps
    if len(steps) < _STEPS:
        return not_applicable(tried, "it took too few steps")
    flown, refused = 0, 0
    for key, value, law, raised in rebuilds(subject):
        failure = raised if law is None else _fails(subject, law, steps[-_STEPS:])
        flown, refused = flown + (law is not None), refused + (law is None)
        if failure:
            other = f"rebuilt({key!r}, {value!r}, {subject.of_law})"
            code = f"other, m = {other}, s[-3].memory; print([m := a.again(other, m)[0] for a in s[-3:]])"
            return judged(tried, f"{key} = {value:.6g}: {failure}", "", subject.snippet(code, _TRACK, **options))
    return judged(tried, "", f"{flown} laws, each with a number 5 % higher; {refused} refused", "")


def _fails(subject: Subject, law: Controller[Any], steps: list[FlownStep]) -> str:
    memory = steps[0].memory
    try:
        for step in steps:
            memory, decision = step.again(law, memory)
            wrong = out_of_limits(subject, decision)
            if wrong:
                return wrong
    except Exception as error:
        return in_words(error)
    return ""
