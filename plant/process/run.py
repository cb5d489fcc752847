"""The plant from its command line to its exit code."""

from colibri.common.errors import Error
from colibri.common.process.lifecycle import Stop, fail
from colibri.common.process.status import Status
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.links.udp import UdpLink, is_bound
from colibri.plant.events import check_events
from colibri.plant.physics.start import default_starts, nudged
from colibri.plant.process.logs import PlantLogs
from colibri.plant.process.reports import closing
from colibri.plant.process.server import FreeServer, Server
from colibri.plant.sensors.suite import served_by
from colibri.plant.simulation.plant import PlantBuilder
from colibri.plant.spec import PlantSpec
from colibri.plant.vehicle.description import load_vehicle


def builder_of(spec: PlantSpec) -> PlantBuilder:
    vehicle = load_vehicle(spec.vehicle).without(spec.without)
    check_events(spec.events, vehicle, on_sensors=vehicle.sensors is not None)
    usual = default_starts(vehicle)
    starts = {it: nudged(spec.started(usual[it])) for it in served_by(vehicle)}
    return PlantBuilder(spec, vehicle, starts, integrator=spec.integrator, origin=spec.home.origin)


def run(spec: PlantSpec, link: UdpLink, status: Status, stop: Stop) -> int:
    try:
        builder = builder_of(spec)
    except Error as error:
        fail(str(error))
    if spec.truth:  # several flights share the cores: whoever waits gives way at once
        link.spin_s = 0.0
    logs = PlantLogs(spec.out, builder.vehicle, spec.boot_unix_us, tlog=spec.tlog) if spec.out else None
    interval_us = round(1e3 / spec.rate) * 1000
    end = PlantEnd(
        system_id=spec.system_id,
        frame_interval_us=interval_us,
        serves=tuple(builder.starts),
        waits=not spec.realtime,
        rotors=builder.vehicle.rotors.count,
        is_there=is_bound,
    )
    server = Server(link, end, status, stop, logs, streams_truth=spec.truth)
    if spec.realtime:
        server = FreeServer(link, end, status, stop, logs, cut_after_s=spec.cut_after)
    with closing(link, logs, out=spec.out):
        if server.wait():
            plant = builder.build(end.feedback, end.frame_interval_us)
            server.fly(plant, duration_s=spec.duration, speed=spec.pace)
    return stop.code
