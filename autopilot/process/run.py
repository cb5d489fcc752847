"""The autopilot as a process: calls a plant over a link, answers its frames, logs what it decided."""

import argparse
from time import perf_counter
from typing import TYPE_CHECKING, Any

from colibri.autopilot.control.profile import Profile, load_profile
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.track_stages import TrackStages, track_autopilot
from colibri.autopilot.estimation.state_source import estimator_for
from colibri.autopilot.guidance.trajectories.loading import file_text, load_track
from colibri.autopilot.process.client import Client
from colibri.autopilot.process.logs import AutopilotLog
from colibri.autopilot.process.options import delay_s
from colibri.autopilot.process.recorded_inputs import Setup
from colibri.common.errors import Error
from colibri.common.process.failure_file import keep_failure
from colibri.common.process.lifecycle import EXIT_FAILED, EXIT_INTERRUPTED, Stop, fail, gc_frozen
from colibri.common.process.status import Status
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.px4_autopilot import FlierEnd
from colibri.mavlink.links.link import BlockingReceiver
from colibri.mavlink.links.open import open_link
from colibri.mavlink.links.udp import UdpLink
from colibri.plant.vehicle.description import Vehicle, load_vehicle

if TYPE_CHECKING:
    from colibri.autopilot.process.ground import Ground


TRACK = "spiral"
"""What flies where nothing else is said."""


def loaded(args: argparse.Namespace) -> tuple[Profile, Vehicle]:
    """Return what a command line flies with.

    Raises:
        ProfileError: There is no such profile, or it is wrong.
        VehicleError: There is no such vehicle.
    """
    profile = load_profile(args.profile).with_choices(args.controller, args.solver, delay_s(args.delay))
    vehicle = load_vehicle(args.vehicle or profile.simulation.vehicle)
    return profile, vehicle


def run(args: argparse.Namespace, link: UdpLink | BlockingReceiver, status: Status, stop: Stop) -> int:
    """Fly the plant at the other end of `link` as the command line says; return the exit code."""
    try:
        profile, vehicle = loaded(args)
        served = args.gcs or args.stepped
        ground = _ground(args, profile, vehicle, status, stop) if served else None
        autopilot: Autopilot[Any] = ground.autopilot if ground else _alone(args, profile, vehicle, status)
        end = _flier(args, vehicle) if args.simulator else _end(args, autopilot.frame_interval_us)
    except Error as error:
        fail(keep_failure(error, args.out))
    log = AutopilotLog(args.out, _setup(args, profile, vehicle), ulog=not args.no_ulog) if args.out else None
    if ground and log:
        ground.record(log)
    if args.stepped and isinstance(link, UdpLink):  # several flights share the cores: who waits gives way at once
        link.spin_s = 0.0
    try:
        with gc_frozen():
            Client(link, end, status, stop, log, ground).fly(autopilot)
    except Error as error:
        fail(keep_failure(error, args.out), EXIT_FAILED)
    finally:
        link.close()
        if ground:
            ground.close()
        if log:
            log.close()
    if ground and ground.errors.failed:
        return EXIT_FAILED
    return 0 if ground and ground.shut_down else EXIT_INTERRUPTED


def _setup(args: argparse.Namespace, profile: Profile, vehicle: Vehicle) -> Setup:
    served = bool(args.gcs or args.stepped)
    flown = args.track if served else args.track or TRACK
    return Setup(
        profile=args.profile,
        controller=profile.controller,
        solver=args.solver,
        delay_s=delay_s(args.delay),
        vehicle=args.vehicle or profile.simulation.vehicle,
        feedback=args.feedback,
        track=flown,
        floor_m=args.floor,
        origin=args.home.origin,
        boot_unix_us=args.boot_unix_us,
        system_id=args.system_id,
        identity=args.identity,
        ground=served,
        profile_tables=profile,
        vehicle_tables=vehicle,
        track_file=flown and file_text(flown),
    )


def _end(args: argparse.Namespace, frame_interval_us: int) -> AutopilotEnd:
    return AutopilotEnd(
        system_id=args.system_id, frame_interval_us=frame_interval_us, now_s=perf_counter(), feedback=args.feedback
    )


def _flier(args: argparse.Namespace, vehicle: Vehicle) -> FlierEnd:
    """Return what flies a simulator that counts the rotors as PX4 does."""
    rotors, order = vehicle.rotors, vehicle.rotors.numbering()
    return FlierEnd(
        system_id=args.system_id,
        now_s=perf_counter(),
        to_motors=lambda speeds: rotors.controls_of(order.to_motors(speeds)),
    )


def _alone(args: argparse.Namespace, profile: Profile, vehicle: Vehicle, status: Status) -> Autopilot[TrackStages]:
    flown, note = load_track(args.track or TRACK, vehicle, profile, args.floor)
    if note:
        status.say("track", note)
    estimator = estimator_for(args.feedback, vehicle, args.home.origin)
    return track_autopilot(profile, vehicle, flown, perf_counter, estimator=estimator)


def _ground(args: argparse.Namespace, profile: Profile, vehicle: Vehicle, status: Status, stop: Stop) -> "Ground":
    """Load what serves ground stations only where there are any: it is as much as all the rest."""
    from colibri.autopilot.process.ground import Ground
    from colibri.autopilot.process.stepped_links import UdpConductor

    conductor = None
    if args.stepped:
        link = open_link(args.stepped)
        link.spin_s = 0.0
        conductor = UdpConductor(link, lambda: stop)
    return Ground(args, profile, vehicle, status, conductor)
