"""`colibri sitl`: vehicles that ground stations connect to, each a plant and an autopilot, until interrupted."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import isfinite
from time import perf_counter

from colibri.autopilot.control.profile import load_profile
from colibri.common.earth.home import HomePlace
from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_BAD_INPUT, EXIT_FAILED, Stop, fail
from colibri.flights.children import Child, end_children, events_of, how_it_ended
from colibri.flights.command_lines import options_of, plant_options
from colibri.flights.fleet_status import StatusLines
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.links.link import LinkError
from colibri.mavlink.links.open import check_reach, open_link
from colibri.plant.physics.start import Start
from colibri.plant.simulation.setting import WorldSetting, world_values
from colibri.plant.vehicle.description import load_vehicle

PLANT_PORT = 14560
GROUND_PORT = 14550
SDK_PORT = 14540
MAX_FLEET = 100


@dataclass(slots=True)
class Member:
    """One vehicle of the fleet.

    Attributes:
        instance: Its number; its ports and system id follow from it.
        links: The URLs that its autopilot serves.
        children: Its processes, as far as they are started.
    """

    instance: int
    links: list[str]
    children: list[Child] = field(default_factory=list)

    @property
    def system_id(self) -> int:
        """MAVLink system id."""
        return self.instance + 1


def ground_links(args: argparse.Namespace, instance: int) -> list[str]:
    """Return the URLs that instance `instance` serves: those of the options, or the two that clients listen on."""
    if args.gcs:
        return list(args.gcs)
    return [f"udpout:127.0.0.1:{GROUND_PORT}", f"udpout:127.0.0.1:{SDK_PORT + instance}"]


def sitl(args: argparse.Namespace) -> int:
    """Fly as the command line says, until interrupted; return the exit code."""
    _check(args)
    if args.out:
        from colibri.flights.fly import prepare

        for instance in range(args.instance, args.instance + args.count):
            prepare(args.out / str(instance))
    fleet = [Member(i, ground_links(args, i)) for i in range(args.instance, args.instance + args.count)]
    stop = Stop()
    lines = StatusLines(quiet=args.quiet)
    try:
        for member in fleet:
            _start_plant(member, args)
        return _watch(fleet, args, stop, lines)
    finally:
        end_children(child for member in fleet for child in member.children)
        lines.close()


def _check(args: argparse.Namespace) -> None:
    """End with one line where the options cannot be flown."""
    try:
        profile = load_profile(args.profile).with_choices(args.controller, None)
        name = args.plant_vehicle or args.vehicle or profile.simulation.vehicle
        vehicle = load_vehicle(name).without(args.without)
        assumed = load_vehicle(args.vehicle or profile.simulation.vehicle)
        check_reach(ground_links(args, args.instance), signed=args.signing_key is not None, insecure=args.insecure)
    except Error as error:
        fail(str(error))
    if args.feedback is Feedback.SENSORS and (vehicle.sensors is None or assumed.sensors is None):
        fail(f"--feedback sensors: vehicle {(assumed if vehicle.sensors else vehicle).name} has no table sensors")
    if vehicle.ground is None and "z" not in args.start:
        fail(f"vehicle {name} has no ground to stand on: fly a vehicle with a table ground, or give --start z=...")
    if not 1 <= args.count <= MAX_FLEET - args.instance:
        fail(f"--instance and --count: at least one vehicle, instances from 0 to {MAX_FLEET - 1}")
    if args.count > 1 and any(url.startswith(("udpin:", "tcpin:")) and not url.endswith(":0") for url in args.gcs):
        fail("--gcs: several vehicles cannot wait on one port; let them call, by udpout: or tcp:, or fly one")
    try:
        for instance in range(args.instance, args.instance + args.count):
            open_link(_plant_url(args, instance)).close()
    except LinkError as error:
        fail(str(error))


def _plant_url(args: argparse.Namespace, instance: int) -> str:
    port = PLANT_PORT + instance
    if args.plant_port is not None:
        port = args.plant_port + instance - args.instance if args.plant_port else 0
    return f"udpin:127.0.0.1:{port}"


def _start_plant(member: Member, args: argparse.Namespace) -> None:
    home: HomePlace = args.home
    start = Start(psi=home.yaw_enu_deg)._replace(**args.start)
    vehicle = args.plant_vehicle or args.vehicle or load_profile(args.profile).simulation.vehicle
    world = WorldSetting(**(world_values(args) | {"start": start, "seed": args.seed + member.instance}))
    options = plant_options(
        world,
        json=True,
        link=_plant_url(args, member.instance),
        vehicle=vehicle,
        duration=args.duration if isfinite(args.duration) else None,
        speed=args.speed,
        home=home,
        system_id=member.system_id,
        out=args.out and args.out / str(member.instance),
    )
    member.children.append(Child("plant", options))


def _start_autopilot(member: Member, args: argparse.Namespace, plant_url: str) -> None:
    options = options_of(
        json=True,
        plant=plant_url.replace("udpin", "udpout"),
        gcs=member.links,
        profile=args.profile,
        vehicle=args.vehicle,
        controller=args.controller,
        feedback=args.feedback,
        home=args.home,
        identity=args.identity,
        state=args.state / str(member.instance),
        signing_key=args.signing_key,
        insecure=args.insecure,
        system_id=member.system_id,
        out=args.out and args.out / str(member.instance),
    )
    member.children.append(Child("autopilot", options))


def _watch(fleet: Sequence[Member], args: argparse.Namespace, stop: Stop, lines: StatusLines) -> int:
    """Show the events of the processes until the last vehicle ends or the user interrupts."""
    flying = list(fleet)
    while flying and not stop:
        over = [member for member in flying if _has_ended(member)]
        _hear(flying, args, lines)
        lines.show(perf_counter())
        for member in over:
            _finish(member)
            lines.forget(member.instance)
            flying.remove(member)
    return 0


def _hear(fleet: Sequence[Member], args: argparse.Namespace, lines: StatusLines) -> None:
    """Read the events of the processes of `fleet`."""
    members = {child: member for member in fleet for child in member.children}
    for child, event in events_of(members):
        member = members[child]
        if child.name == "plant" and event["event"] == "listening":
            _start_autopilot(member, args, event["url"])
        lines.add(member.instance, child.name, event)


def _has_ended(member: Member) -> bool:
    return any(child.code() is not None for child in member.children)


def _finish(member: Member) -> None:
    """End what is left of a vehicle whose time is over, or that a ground station has shut down.

    Where a process came to another end, everything ends, with its exit code.
    """
    for child in reversed(member.children):
        code = child.code()
        if code in (EXIT_FAILED, EXIT_BAD_INPUT):  # of these it has said why
            raise SystemExit(code)
        if code:
            fail(f"the {child.name} of instance {member.instance} {how_it_ended(code)}", EXIT_FAILED)
    end_children(member.children)
