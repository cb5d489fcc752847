"""The plant from its command line to its exit code."""

import argparse

from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_INTERRUPTED, Stop, fail
from colibri.common.process.status import Status
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.links.udp import UdpLink
from colibri.plant.physics.start import DEFAULT_STARTS
from colibri.plant.process.logs import PlantLogs
from colibri.plant.process.options import nudged
from colibri.plant.process.reports import closing
from colibri.plant.process.server import FreeServer, Server
from colibri.plant.sensors.suite import served_by
from colibri.plant.simulation.plant import PlantBuilder
from colibri.plant.simulation.setting import WorldSetting, world_values
from colibri.plant.vehicle.description import load_vehicle


def builder_of(args: argparse.Namespace) -> PlantBuilder:
    """Return what builds the plant of a command line.

    Raises:
        VehicleError: There is no such vehicle, or it cannot start like that.
    """
    vehicle = load_vehicle(args.vehicle).without(args.without)
    starts = {it: nudged(DEFAULT_STARTS[it]._replace(**args.start)) for it in served_by(vehicle)}
    setting = WorldSetting(**world_values(args))
    return PlantBuilder(setting, vehicle, starts, integrator=args.integrator, origin=args.home.origin)


def run(args: argparse.Namespace, link: UdpLink, status: Status, stop: Stop) -> int:
    """Serve one flight on `link` as the command line asks; return the exit code."""
    try:
        builder = builder_of(args)
    except Error as error:
        fail(str(error))
    if args.truth:  # several flights share the cores: whoever waits gives way at once
        link.spin_s = 0.0
    logs = PlantLogs(args.out, builder.vehicle, args.boot_unix_us, ulog=not args.no_ulog) if args.out else None
    interval_us = round(1e3 / args.rate) * 1000
    end = PlantEnd(
        system_id=args.system_id, frame_interval_us=interval_us, serves=tuple(builder.starts), waits=not args.realtime
    )
    server = Server(link, end, status, stop, logs, streams_truth=args.truth)
    if args.realtime:
        server = FreeServer(link, end, status, stop, logs, cut_after_s=args.cut_after)
    with closing(link, logs, out=args.out):
        if server.wait():
            plant = builder.build(end.feedback, end.frame_interval_us)
            server.fly(plant, duration_s=args.duration, speed=args.speed)
    return EXIT_INTERRUPTED if stop else 0
