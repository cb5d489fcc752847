"""The parts of a vehicle that ground stations fly, put together around one profile."""

from contextlib import suppress
from dataclasses import dataclass

from colibri.autopilot.commander.fence import Fence
from colibri.autopilot.commander.home import Home
from colibri.autopilot.commander.missions import Missions
from colibri.autopilot.commander.mode_tasks import ModeTasks
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.commander.supervisor import Supervisor
from colibri.autopilot.control.delay import DelayCompensation
from colibri.autopilot.control.interface import Clock
from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.rotor_loss.rotor_loss import RotorLoss
from colibri.autopilot.core.actuation import Actuation
from colibri.autopilot.core.defence.errors import Defence
from colibri.autopilot.core.subscription import Subscribers
from colibri.autopilot.core.trial import VehicleTrial
from colibri.autopilot.estimation.state_source import NewEstimator, StateSource
from colibri.autopilot.ground.battery_monitor import BatteryMonitor
from colibri.autopilot.ground.snapshots import SnapshotBuilder
from colibri.autopilot.ground.stations import Stations, StationSettings
from colibri.autopilot.guidance.attitude_reference import AttitudeReference, attitude_limits
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.guidance import instants
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.autopilot.identities import conventions_of
from colibri.autopilot.parameters.definitions import ImpossibleError, Numbers, behaviour
from colibri.autopilot.parameters.retuning import Retuning, Tuned, builder
from colibri.mavlink.node.budget import Budget
from colibri.mavlink.parameters.store import Parameters, Value
from colibri.mavlink.services.statustext import WARNING
from colibri.plant.vehicle.description import Vehicle

_LOADED = set[tuple[str, str, int, bool]]()
"""Whose compiled code was loaded by a trial: law, profile, number of rotors, and whether they are flat."""


@dataclass(frozen=True, slots=True)
class Parts:
    parameters: Parameters
    subscribers: Subscribers
    loop: ControlLoop
    delay: DelayCompensation
    state_source: StateSource
    actuation: Actuation
    rotor_loss: RotorLoss
    battery: BatteryMonitor
    tasks: ModeTasks
    pilot: Pilot
    supervisor: Supervisor
    stations: Stations
    snapshots: SnapshotBuilder
    lines: StatusQueue
    defence: Defence
    budget: Budget


def parts_of(
    profile: Profile,
    vehicle: Vehicle,
    settings: StationSettings,
    clock: Clock,
    values: dict[str, Value] | None,
    first: Track | None,
    estimator: NewEstimator | None,
    strict: bool,
) -> Parts:
    """Return the parts of a vehicle; arguments and errors are those of `copter_autopilot`."""
    numbers = Numbers(profile, vehicle)
    conventions = conventions_of(settings.identity)
    parameters = conventions.parameters(numbers.of_vehicle(settings.system_id), settings.system_id)
    parameters.load(values or {})
    flown, assumed = numbers.applied(parameters.values)
    flies_by = behaviour(parameters)
    loop = ControlLoop(flown, assumed, clock, on_sensors=estimator is not None)
    limits = attitude_limits(flies_by, free=loop.tilts_freely)
    attitude = AttitudeReference(assumed, loop.preview, limits) if loop.takes_attitude else None
    planned_at = instants(loop.preview, loop.control_interval_us)
    home, lines, budget = Home(settings.origin), StatusQueue(), Budget()
    fence = Fence(home, flies_by, budget)
    missions = Missions(home, fence, lines, flies_by)
    tasks = ModeTasks(missions, attitude, assumed, loop.preview, planned_at, profile.references, first, budget)
    pilot = Pilot(planned_at, flies_by, tasks.begin, home, lines)
    defence = Defence(pilot, lines.say, strict=strict)
    stations = Stations(
        *(settings, pilot, missions, fence, lines, parameters, vehicle, tasks, conventions),
        takes_attitude=attitude is not None,
        defence=defence,
        budget=budget,
    )
    supervisor = Supervisor(parameters, lines)
    rotor_loss = RotorLoss(assumed, loop.control_interval_us)
    rotor_loss.obey(flies_by)
    if rotor_loss.impossible:
        lines.say(WARNING, f"no landing on three rotors: {rotor_loss.impossible}")
    actuation = Actuation(loop, rotor_loss)
    delay = DelayCompensation(assumed)

    def obey_delay(flies_by: Behaviour) -> None:
        delay.declare(profile.delay_s if flies_by.delay_s < 0.0 else flies_by.delay_s)

    obey_delay(flies_by)
    battery = BatteryMonitor(assumed)
    trial = VehicleTrial(loop, rotor_loss, planned_at)
    tuning = Retuning(numbers, builder(profile.controller, clock), loop, stations.warn, parameters, trial, budget)
    if values:
        tuning.try_all(parameters.values)
    elif (kind := (profile.controller, profile.where, vehicle.rotors.count, vehicle.is_flat)) not in _LOADED:
        _LOADED.add(kind)  # what a change in flight needs
        with suppress(ImpossibleError):
            tuning.try_all(parameters.values)
    parameters.ask(tuning.prepare, tuning.is_ready)
    snapshots = SnapshotBuilder(assumed, loop.control_interval_us * 1e-6, loop.plan_columns)
    leads = () if attitude is None else (attitude,)
    subscribers = Subscribers(
        parameters=(supervisor.adopt, battery.adopt),
        behaviour=(pilot.adopt, missions.adopt, rotor_loss.obey, obey_delay, *(part.obey for part in leads)),
        law=(loop.adopt,),
        vehicle=(
            *(tasks.adopt, rotor_loss.adopt, actuation.adopt, delay.adopt, snapshots.adopt),
            *(part.adopt for part in leads),
        ),
        values=parameters.values,
        tuned=Tuned(flown, assumed, loop.controller),
    )

    def rebuild(lost: int | None) -> None:
        tuning.lost = lost
        subscribers.fly(tuning.built(parameters.values))

    rotor_loss.rebuild = rebuild
    state_source = StateSource(estimator, loop.frame_interval_us)
    return Parts(
        *(parameters, subscribers, loop, delay, state_source, actuation, rotor_loss, battery),
        *(tasks, pilot, supervisor, stations, snapshots, lines, defence, budget),
    )
