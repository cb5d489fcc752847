"""The plant from its command line to its exit code."""

import argparse

from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_FAILED, EXIT_INTERRUPTED, Stop, fail, undisturbed
from colibri.common.process.status import Status
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.links.udp import UdpLink
from colibri.plant.physics.start import DEFAULT_STARTS
from colibri.plant.physics.world import Physics, starting_world
from colibri.plant.process.logs import PlantLogs
from colibri.plant.process.options import nudged, weather_of
from colibri.plant.process.server import Server
from colibri.plant.sensors.suite import served_by
from colibri.plant.simulation.plant import Plant
from colibri.plant.vehicle.description import load_vehicle


def run(args: argparse.Namespace, link: UdpLink, status: Status, stop: Stop) -> int:
    """Serve one flight on `link` as the command line says; return the exit code."""
    try:
        weather = weather_of(args)
        vehicle = load_vehicle(args.vehicle).without(args.without)
        serves = served_by(vehicle)
        worlds = {
            it: starting_world(nudged(DEFAULT_STARTS[it]._replace(**args.start)), vehicle, weather) for it in serves
        }
    except Error as error:
        fail(str(error))
    physics = Physics(vehicle, args.integrator, weather)
    if args.truth:  # several flights share the cores: whoever waits gives way at once
        link.spin_s = 0.0
    logs = PlantLogs(args.out) if args.out else None
    interval_us = round(1e3 / args.rate) * 1000
    end = PlantEnd(system_id=args.system_id, frame_interval_us=interval_us, serves=serves, waits=not args.realtime)
    server = Server(link, end, status, stop, logs, tells_truth=args.truth)
    if args.realtime:
        from colibri.plant.process.free_running import FreeServer

        server = FreeServer(link, end, status, stop, logs, cut_after_s=args.cut_after)
    try:
        with undisturbed():
            if server.wait():
                plant = Plant(
                    worlds[end.feedback],
                    vehicle,
                    physics,
                    end.feedback,
                    args.home.origin,
                    seed=args.seed,
                    interval_us=end.frame_interval_us,
                    latency_us=round(args.latency * 1e3),
                )
                server.fly(plant, duration_s=args.duration, speed=args.speed)
    except Error as error:
        fail(str(error), EXIT_FAILED)
    finally:
        link.close()
        if logs:
            logs.close()
    return EXIT_INTERRUPTED if stop else 0
