"""The plant as a server of ArduPilot: it answers on a link, and ArduPilot's clock is the only one."""

import argparse
from time import perf_counter

from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_FAILED, EXIT_INTERRUPTED, Stop, fail, gc_frozen
from colibri.common.process.log_files import CsvLog
from colibri.common.process.status import Progress, Status
from colibri.common.types import Address
from colibri.mavlink.links.udp import UdpLink
from colibri.plant.environment.weather import weather_of
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, starting_world
from colibri.plant.process.ardupilot import ArduPilotEnd
from colibri.plant.process.logs import TRUTH_COLUMNS, truth_row
from colibri.plant.process.options import nudged
from colibri.plant.vehicle.description import load_vehicle

_SILENCE_SAID_AFTER_S = 2.0
_MAX_WAIT_S = 0.1


def run(args: argparse.Namespace, link: UdpLink, status: Status, stop: Stop) -> int:
    """Serve ArduPilot on `link` as the command line says; return the exit code."""
    try:
        weather = weather_of(args)
        vehicle = load_vehicle(args.vehicle).without(args.without)
        motors = vehicle.rotors.numbering()
        start = starting_world(nudged(Start(psi=args.home.yaw_enu_deg)._replace(**args.start)), vehicle, weather)
    except Error as error:
        fail(str(error))
    frame_type = motors.ardupilot_frame_type
    expo = 1 if vehicle.rotors.control == "speed" else 0
    text = f"{vehicle.name} is FRAME_CLASS 1, FRAME_TYPE {frame_type}, MOT_THST_EXPO {expo}"
    status.say("frame", text, frame_class=1, frame_type=frame_type, thrust_expo=expo)
    end = ArduPilotEnd(Physics(vehicle, args.integrator, weather), start, motors, vehicle.rotors)
    log = CsvLog(args.out / "plant.csv", TRUTH_COLUMNS) if args.out else None
    try:
        with gc_frozen():
            _serve(end, link, status, stop, log, duration_s=args.duration)
    except Error as error:
        fail(str(error), EXIT_FAILED)
    finally:
        link.close()
        if log:
            log.close()
    return EXIT_INTERRUPTED if stop else 0


def _serve(
    end: ArduPilotEnd, link: UdpLink, status: Status, stop: Stop, log: CsvLog | None, *, duration_s: float
) -> None:
    """Answer until the simulated time is over or the process is told to stop."""
    began_s = heard_s = perf_counter()
    progress, silence_said, logged = Progress(status), False, None
    while not stop and end.world.time_us < duration_s * 1e6:
        received = link.receive(_MAX_WAIT_S)
        now_s = perf_counter()
        if received is None:
            if end.peer and not silence_said and now_s - heard_s > _SILENCE_SAID_AFTER_S:
                silence_said = True
                text = f"no request at t = {end.world.time_us / 1e6:.3f} s, waiting for ArduPilot"
                status.say("silence", text)
            continue
        if end.peer is None:
            began_s = now_s
        if not _answer(end, link, received, now_s):
            continue
        heard_s = now_s
        if silence_said:
            silence_said = False
            status.say("answered", "ArduPilot asks again")
        if log and end.world is not logged:
            logged = end.world
            log.write(truth_row(logged))
        progress.report(end.world.time_us / 1e6, now_s - began_s)
    status.say(
        "ended",
        f"ended at t = {end.world.time_us / 1e6:.3f} s after {end.steps} steps",
        sim_time_s=end.world.time_us / 1e6,
        wall_time_s=perf_counter() - began_s,
        steps=end.steps,
        restarts=end.restarts,
        dropped=dict(end.dropped),
    )


def _answer(end: ArduPilotEnd, link: UdpLink, received: tuple[bytes, Address], now_s: float) -> bool:
    """Answer what has come; return whether anything was answered.

    A request that has come again before it was answered, while the plant was loading say, is answered once: ArduPilot
    would take the second reply for that to its next request, and so fly a step late for good.
    """
    answered = False
    for datagram, sender in dict.fromkeys([received, *link.receive_now()]):
        reply = end.receive(datagram, sender, now_s)
        if reply is not None:
            link.send(reply, sender)
            answered = True
    return answered
