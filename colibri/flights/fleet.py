"""`colibri sitl`: vehicles that ground stations connect to, each a plant and an autopilot, until interrupted."""

import argparse
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from math import isfinite
from time import perf_counter, time

from colibri.autopilot.control.profile import load_profile
from colibri.common.earth.geodesy import geodetic_of
from colibri.common.earth.home import HomePlace
from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_BAD_INPUT, EXIT_FAILED, Stop, fail
from colibri.common.process.log_files import set_aside
from colibri.flights.children import Child, end_children, events_of, how_it_ended
from colibri.flights.command_lines import options_of, plant_options
from colibri.flights.fleet_status import StatusLines
from colibri.flights.folder import LOGS, occupied, prepare
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
_MAX_DEATHS, _LOOP_S = 3, 60.0
"""A vehicle whose processes die more often than that in that time is not started again."""
_OF_AUTOPILOT = ("autopilot.csv", "estimate.csv", "filter.csv")
"""What an autopilot writes anew; `inputs.jsonl` goes on where the one before has died."""


@dataclass(slots=True, eq=False)
class Member:
    """One vehicle of the fleet.

    Attributes:
        instance: Its number; its ports and system id follow from it.
        east_m: How far it stands east of `--home`.
        links: The URLs that its autopilot serves; once it has opened them, with the ports that it has got.
        children: Its processes, as far as they are started.
        plant_url: Where its plant listens.
        boot_unix_us: Unix time when its plant was started, which dates its telemetry logs.
        deaths_s: When a process of it has died, by the wall clock.
    """

    instance: int
    east_m: float
    links: list[str]
    children: list[Child] = field(default_factory=list)
    plant_url: str = ""
    boot_unix_us: int = 0
    deaths_s: list[float] = field(default_factory=list)

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
    instances = range(args.instance, args.instance + args.count)
    fleet = [Member(it, number * args.spacing, ground_links(args, it)) for number, it in enumerate(instances)]
    with ExitStack() as held:
        for instance in instances if args.out else ():
            held.enter_context(occupied(args.out / str(instance)))
            prepare(args.out / str(instance))
        stop = Stop()
        lines = StatusLines(quiet=args.quiet)
        lines.begin(args.count)
        try:
            for member in fleet:
                _start_plant(member, args)
            _watch(fleet, args, stop, lines)
        finally:
            end_children(child for member in fleet for child in member.children)
            lines.close()
    return EXIT_FAILED if any(child.code() == EXIT_FAILED for member in fleet for child in member.children) else 0


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
    if args.count > 1 and any(_taken_by_one(url) for url in args.gcs):
        fail("--gcs: several vehicles cannot have one port; let them call, by udpout: or tcp:, or fly one")
    try:
        for instance in range(args.instance, args.instance + args.count):
            open_link(_plant_url(args, instance)).close()
    except LinkError as error:
        fail(str(error))


def _taken_by_one(url: str) -> bool:
    return url.startswith("serial:") or (url.startswith(("udpin:", "tcpin:")) and not url.endswith(":0"))


def _plant_url(args: argparse.Namespace, instance: int) -> str:
    port = PLANT_PORT + instance
    if args.plant_port is not None:
        port = args.plant_port + instance - args.instance if args.plant_port else 0
    return f"udpin:127.0.0.1:{port}"


def place_of(member: Member, args: argparse.Namespace) -> HomePlace:
    """Return where a vehicle stands: in a row to the east, each with an origin of its own."""
    home: HomePlace = args.home
    if not member.east_m:
        return home
    return HomePlace(*geodetic_of((member.east_m, 0.0, 0.0), home.origin)._replace(altitude_m=home.altitude_m), home[3])


def _start_plant(member: Member, args: argparse.Namespace) -> None:
    member.boot_unix_us = round(time() * 1e6)
    home = place_of(member, args)
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
        boot_unix_us=member.boot_unix_us,
        out=args.out and args.out / str(member.instance),
    )
    member.children.append(Child("plant", options))


def _start_autopilot(member: Member, args: argparse.Namespace) -> None:
    options = options_of(
        json=True,
        plant=member.plant_url.replace("udpin", "udpout"),
        gcs=member.links,
        profile=args.profile,
        vehicle=args.vehicle,
        controller=args.controller,
        feedback=args.feedback,
        home=place_of(member, args),
        identity=args.identity,
        state=args.state / str(member.instance),
        signing_key=args.signing_key,
        insecure=args.insecure,
        strict=args.strict,
        system_id=member.system_id,
        boot_unix_us=member.boot_unix_us,
        out=args.out and args.out / str(member.instance),
    )
    member.children.append(Child("autopilot", options))


def _watch(fleet: Sequence[Member], args: argparse.Namespace, stop: Stop, lines: StatusLines) -> None:
    """Show the events of the processes until the last vehicle ends or the user interrupts."""
    flying = list(fleet)
    while flying and not stop:
        codes = {member: [child.code() for child in member.children] for member in flying}
        _hear(flying, args, lines)
        lines.show(perf_counter())
        for member, of_children in codes.items():
            if 0 in of_children:  # its time is over, or a ground station has shut it down
                end_children(reversed(member.children))
                lines.forget(member.instance)
                flying.remove(member)
            elif any(of_children):
                start_again(member, args, lines)


def _hear(fleet: Sequence[Member], args: argparse.Namespace, lines: StatusLines) -> None:
    """Read the events of the processes of `fleet`."""
    members = {child: member for member in fleet for child in member.children}
    for child, event in events_of(members):
        member = members[child]
        match event["event"]:
            case "listening" if child.name == "plant":
                member.plant_url = event["url"]
                _start_autopilot(member, args)
            case "ground":
                member.links[event["link"]] = event["url"]
            case "status":
                event["position_enu_m"][0] += member.east_m
        lines.add(member.instance, child.name, event)


def start_again(member: Member, args: argparse.Namespace, lines: StatusLines) -> None:
    """Start again what has died of a vehicle: the autopilot, which goes on; or the plant, and with it both.

    Where a process cannot begin, or dies again and again, everything ends.
    """
    child, code = next((child, code) for child in member.children if (code := child.code()))
    if code == EXIT_BAD_INPUT:  # it has said why
        raise SystemExit(code)
    now_s = perf_counter()
    member.deaths_s = [*(death_s for death_s in member.deaths_s if death_s > now_s - _LOOP_S), now_s]
    if len(member.deaths_s) > _MAX_DEATHS:
        how = f"{how_it_ended(code)}, the {len(member.deaths_s)}th death within {_LOOP_S:.0f} s"
        fail(f"the {child.name} of instance {member.instance} {how}", EXIT_FAILED)
    lines.died(member.instance, child.name, f"{how_it_ended(code)}; started again")
    if child.name == "plant":
        end_children(reversed(member.children))
        _set_aside(member, args, LOGS)
        member.children.clear()
        _start_plant(member, args)
    else:
        end_children([child])
        _set_aside(member, args, _OF_AUTOPILOT)
        member.children.remove(child)
        _start_autopilot(member, args)


def _set_aside(member: Member, args: argparse.Namespace, names: Sequence[str]) -> None:
    """Give logs of processes that have died names of their own: autopilot.csv becomes autopilot-1.csv."""
    for name in names if args.out else ():
        set_aside(args.out / str(member.instance) / name)
