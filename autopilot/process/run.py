"""The autopilot process."""

from time import perf_counter
from typing import TYPE_CHECKING, Any

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.track_stages import TrackStages, track_autopilot
from colibri.autopilot.estimation.state_source import estimator_for
from colibri.autopilot.guidance.trajectories.loading import file_text, load_track
from colibri.autopilot.process.client import PlantClient
from colibri.autopilot.process.logs import log_in
from colibri.autopilot.process.recorded_inputs import setup_of
from colibri.autopilot.spec import TRACK, AutopilotSpec
from colibri.common.errors import Error
from colibri.common.process.failure_file import keep_failure
from colibri.common.process.lifecycle import EXIT_FAILED, Stop, fail, gc_frozen
from colibri.common.process.status import Status
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.px4_autopilot import FlierEnd
from colibri.mavlink.links.link import BlockingReceiver
from colibri.mavlink.links.open import open_link
from colibri.mavlink.links.udp import UdpLink
from colibri.plant.vehicle.description import Vehicle

if TYPE_CHECKING:
    from colibri.autopilot.process.ground import GroundService


def run(spec: AutopilotSpec, link: UdpLink | BlockingReceiver, status: Status, stop: Stop) -> int:
    try:
        profile, vehicle = spec.load()
        if spec.params and not spec.served:
            from colibri.autopilot.parameters.definitions import with_parameters  # slow to load

            profile, vehicle = with_parameters(profile, vehicle, spec.params, served=False)
        ground = _ground(spec, profile, vehicle, status, stop) if spec.served else None
        autopilot: Autopilot[Any] = ground.autopilot if ground else _alone(spec, profile, vehicle, status)
        end = _flier(spec, vehicle) if spec.simulator else _end(spec, autopilot.frame_interval_us)
        setup = (
            setup_of(spec, profile, vehicle, None if spec.flown is None else file_text(spec.flown))
            if spec.out
            else None
        )
    except Error as error:
        fail(keep_failure(error, spec.out))
    log = log_in(spec.out, setup) if spec.out and setup else None
    if ground and log:
        ground.record(log)
    if spec.stepped and isinstance(link, UdpLink):  # several flights share the cores: who waits gives way at once
        link.spin_s = 0.0
    try:
        with gc_frozen():
            PlantClient(link, end, status, stop, log, ground).fly(autopilot)
    except Error as error:
        fail(keep_failure(error, spec.out), EXIT_FAILED)
    finally:
        link.close()
        if ground:
            ground.close()
        if log:
            log.close()
    if ground and ground.errors.failed:
        return EXIT_FAILED
    return stop.code


def _end(spec: AutopilotSpec, frame_interval_us: int) -> AutopilotEnd:
    return AutopilotEnd(
        system_id=spec.system_id, frame_interval_us=frame_interval_us, now_s=perf_counter(), feedback=spec.feedback
    )


def _flier(spec: AutopilotSpec, vehicle: Vehicle) -> FlierEnd:
    rotors, order = vehicle.rotors, vehicle.rotors.numbering()
    return FlierEnd(
        system_id=spec.system_id,
        now_s=perf_counter(),
        to_motors=lambda speeds: rotors.controls_of(order.to_motors(speeds)),
    )


def _alone(spec: AutopilotSpec, profile: Profile, vehicle: Vehicle, status: Status) -> Autopilot[TrackStages]:
    flown, note = load_track(spec.flown or TRACK, vehicle, profile, spec.floor)
    if note:
        status.say("track", note)
    estimator = estimator_for(spec.feedback, vehicle, spec.home.origin)
    autopilot = track_autopilot(profile, vehicle, flown, perf_counter, estimator=estimator, law=spec.law)
    autopilot.stages.loop.hide_plan()
    return autopilot


def _ground(spec: AutopilotSpec, profile: Profile, vehicle: Vehicle, status: Status, stop: Stop) -> "GroundService":
    from colibri.autopilot.process.ground import GroundService
    from colibri.autopilot.process.stepped_links import UdpConductor

    conductor = None
    if spec.stepped:
        link = open_link(spec.stepped)
        link.spin_s = 0.0
        conductor = UdpConductor(link, lambda: stop)
    return GroundService(spec, profile, vehicle, status, conductor)
