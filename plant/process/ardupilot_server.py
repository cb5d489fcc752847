"""The plant as a server of ArduPilot: it answers on a link, and ArduPilot's clock is the only one."""

import argparse
from time import perf_counter
from typing import Any

from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_INTERRUPTED, Stop, fail
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
from colibri.plant.process.reports import MAX_WAIT_S, SILENT_AFTER_S, Silence, closing, report_end
from colibri.plant.vehicle.description import load_vehicle


def run(args: argparse.Namespace, link: UdpLink, status: Status, stop: Stop) -> int:
    """Serve ArduPilot on `link` as the command line asks; return the exit code."""
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
    with closing(link, log):
        _serve(end, link, status, stop, log, duration_s=args.duration)
    return EXIT_INTERRUPTED if stop else 0


def _serve(
    end: ArduPilotEnd, link: UdpLink, status: Status, stop: Stop, log: CsvLog | None, *, duration_s: float
) -> None:
    began_s = perf_counter()
    silence = Silence(status, SILENT_AFTER_S, "ArduPilot asks again", began_s)
    progress, logged = Progress(status), None
    while not stop and end.world.time_us < duration_s * 1e6:
        received = link.receive(MAX_WAIT_S)
        now_s = perf_counter()
        if received is None:
            if end.peer:
                silence.lasts(now_s, "no request", end.world.time_us, ", waiting for ArduPilot")
            continue
        if end.peer is None:
            began_s = now_s
        if not _answer(end, link, received, now_s):
            continue
        silence.end(now_s)
        if log and end.world is not logged:
            logged = end.world
            log.add(truth_row(logged))
        progress.report(end.world.time_us / 1e6, now_s - began_s)
    if log:
        log.flush()
    figures: dict[str, Any] = {"steps": end.steps, "restarts": end.restarts, "dropped": dict(end.dropped)}
    report_end(status, end.world.time_us, began_s, f"ended {{}} after {end.steps} steps", **figures)


def _answer(end: ArduPilotEnd, link: UdpLink, received: tuple[bytes, Address], now_s: float) -> bool:
    """Answer what has come; return whether anything was answered.

    A request that has come again before it was answered, for instance while the plant was loading, is answered once:
    ArduPilot would take the second reply for that to its next request, and so fly a step late for good.
    """
    answered = False
    for datagram, sender in dict.fromkeys([received, *link.receive_now()]):
        reply = end.receive(datagram, sender, now_s)
        if reply is not None:
            link.send(reply, sender)
            answered = True
    return answered
