"""`colibri sitl`: vehicles for ground stations, until interrupted."""

import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from time import perf_counter, time
from typing import Any, Literal

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.process.planned_events import station_events
from colibri.autopilot.spec import AutopilotSpec, name_of
from colibri.common.earth.geodesy import geodetic_of
from colibri.common.earth.home import HomePlace
from colibri.common.process.lifecycle import EXIT_BAD_INPUT, EXIT_FAILED, Stop, fail, one_line
from colibri.common.process.log_files import set_aside
from colibri.common.spec import part_of
from colibri.flights.effects import FlownOptions, in_words, without_effect
from colibri.flights.fleet_spec import PLANT_PORT, FleetSpec
from colibri.flights.folder import LOGS, occupied, prepare
from colibri.flights.launcher import Child, end_children, events_of, how_it_ended
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.links.open import check_reach, open_link
from colibri.plant.events import check_events, plant_events
from colibri.plant.physics.start import Start
from colibri.plant.spec import PlantSpec
from colibri.plant.vehicle.description import load_vehicle

_REDRAW_EVERY_S = 0.5
_SHOWN = ("compiling", "ground", "said", "heard", "silence", "answered", "refused", "flying", "error")
"""Events with a line of their own."""
_COLUMNS = dict(id=3, time=6, real=6, mode=10, rotors=8, east=6, north=6, up=7, speed=8, solver=6)
"""Least widths: enough for usual values, so that columns stay in place."""
_FIRST = ("id", "mode", "up", "rotors", "time", "speed", "east", "north", "real", "solver")
"""Columns by priority, for a narrow terminal."""
_LINKS_WIDTH = 66  # below this width, links are shown without scheme and rates


class StatusLines:
    def __init__(self, *, quiet: bool) -> None:
        self._console = Console(stderr=True, highlight=False, soft_wrap=True)
        self._facts: dict[int, dict[str, Any]] = {}
        self._quiet = quiet
        self._drawn_s = 0.0
        self._live: Live | None = None

    def begin(self, vehicles: int, note: str = "") -> None:
        if note and not self._quiet:
            self._console.print(note, markup=False)
        if self._console.is_terminal and not self._quiet:
            self._console.print("starting" + (f" {vehicles} vehicles" if vehicles > 1 else ""), markup=False)

    def add(self, instance: int, name: str, event: dict[str, Any]) -> None:
        if event["event"] == "status":
            self._facts[instance] = event
        elif event["event"] in _SHOWN and event.get("functions", 1) == 1 and not self._quiet:
            self._console.print(f"{instance + 1:3d} {name}: {event['text']}", markup=False)

    def died(self, instance: int, name: str, how: str) -> None:
        """Print a death, even if quiet."""
        self._console.print(f"{instance + 1:3d} {name} {how}", markup=False)

    def show(self, now_s: float) -> None:
        if self._quiet or not self._console.is_terminal or not self._facts or now_s < self._drawn_s + _REDRAW_EVERY_S:
            return
        self._drawn_s = now_s
        if self._live is None:
            self._live = Live(console=self._console, auto_refresh=False, transient=False)
            self._live.start()
        self._live.update(status_table(self._facts, self._console.width), refresh=True)

    def forget(self, instance: int) -> None:
        self._facts.pop(instance, None)

    def close(self) -> None:
        if self._live is not None:
            self._live.stop()
        sys.stderr.flush()


def status_table(facts: dict[int, dict[str, Any]], width: int = 80) -> Group:
    """Return a row per vehicle and per link; in a fleet, only links with a ground station."""
    shown = _shown(width)
    vehicles = Table(box=None, padding=(0, 1, 0, 0), header_style="dim")
    for heading in shown:
        side: Literal["left", "right"] = "left" if heading in ("mode", "rotors") else "right"
        vehicles.add_column(heading, no_wrap=True, min_width=_COLUMNS[heading], justify=side)
    links = Table(box=None, padding=(0, 2, 0, 0), show_header=False, style="dim")
    for column in range(5):
        links.add_column(no_wrap=True, justify="left" if column in (1, 2) else "right")
    for instance, fact in sorted(facts.items()):
        system = str(instance + 1)
        texts = dict(zip(_COLUMNS, (system, *_vehicle_texts(fact)), strict=True))
        vehicles.add_row(*(texts[heading] for heading in shown))
        for link in fact["links"]:
            if link["heard"] or len(facts) == 1:
                links.add_row(f"{system:>3}", *_link_texts(link, width))
    return Group(vehicles, links)


def _shown(width: int) -> list[str]:
    shown = [_FIRST[0]]
    for heading in _FIRST[1:]:
        if sum(_COLUMNS[each] + 1 for each in (*shown, heading)) > width:
            break
        shown.append(heading)
    return sorted(shown, key=[*_COLUMNS].index)


def _vehicle_texts(fact: dict[str, Any]) -> tuple[str, ...]:
    x, y, z = (round(value, 1) + 0.0 for value in fact["position_enu_m"])  # + 0.0: no minus before a zero
    return (
        f"{fact['sim_time_s']:.0f} s",
        f"x {fact['times_real_time']:.2f}",
        fact["mode"],
        "armed" if fact["armed"] else "disarmed",
        *(f"{x:.1f}", f"{y:.1f}", f"{z:.1f} m"),
        f"{fact['speed_m_s']:.1f} m/s",
        f"{fact['solve_time_us']:.0f} µs",
    )


def _link_texts(link: dict[str, Any], width: int) -> tuple[str, ...]:
    source = " ".join(["from", *link["heard"]]) if link["heard"] else "no client"
    if width < _LINKS_WIDTH:
        return (link["url"].partition(":")[2], source)
    return (link["url"], source, f"{link['received_hz']:.0f}/s in", f"{link['sent_hz']:.0f}/s out")


MAX_FLEET = 100
_MAX_DEATHS, _LOOP_S = 3, 60.0  # a vehicle with more deaths of its processes in this time ends the fleet


@dataclass(slots=True, eq=False)
class Member:
    instance: int  # ports and system id follow from it
    east_m: float
    links: list[str]  # URLs that its autopilot serves; once open, with actual ports
    children: list[Child] = field(default_factory=list)
    plant_url: str = ""
    boot_unix_us: int = 0  # start of its plant, which dates telemetry logs
    deaths_s: list[float] = field(default_factory=list)


def sitl(spec: FleetSpec, *, quiet: bool) -> int:
    with one_line():
        note = "\n".join(filter(None, (_check(spec), spec.connect())))
    instances = range(spec.instance, spec.instance + spec.count)
    fleet = [Member(it, number * spec.spacing, spec.links(it)) for number, it in enumerate(instances)]
    with ExitStack() as held:
        for folder in filter(None, map(spec.folder, instances)):
            held.enter_context(occupied(folder))
            prepare(folder)
        stop = Stop()
        lines = StatusLines(quiet=quiet)
        lines.begin(spec.count, note)
        try:
            for member in fleet:
                _start_plant(member, spec)
            _watch(fleet, spec, stop, lines)
        finally:
            end_children(child for member in fleet for child in member.children)
            lines.close()
    return EXIT_FAILED if any(child.code() == EXIT_FAILED for member in fleet for child in member.children) else 0


def _check(spec: FleetSpec) -> str:
    profile, assumed = spec.load()
    name = name_of(spec.plant_vehicle or spec.vehicle or profile.simulation.vehicle)
    whole = load_vehicle(spec.plant_vehicle) if spec.plant_vehicle else assumed
    vehicle, on_sensors = whole.without(spec.without), spec.feedback is Feedback.SENSORS
    check_events(spec.events, vehicle, on_sensors=on_sensors, served=True)
    station_events(spec.events)
    check_reach(spec.links(spec.instance), signed=spec.signing_key is not None, insecure=spec.insecure)
    if on_sensors and (vehicle.sensors is None or assumed.sensors is None):
        fail(f"--feedback sensors: vehicle {(assumed if vehicle.sensors else vehicle).name} has no table sensors")
    if vehicle.ground is None and "z" not in spec.start:
        fail(f"vehicle {name} has no ground to stand on: fly a vehicle with a table ground, or give --start z=...")
    if not 1 <= spec.count <= MAX_FLEET - spec.instance:
        fail(f"--instance and --count: at least one vehicle, instances from 0 to {MAX_FLEET - 1}")
    listening = (url for url in spec.gcs if url.startswith(("udpin:", "tcpin:")) and not url.endswith(":0"))
    if spec.count > 1 and (any(listening) or any(url.startswith("serial:") for url in spec.gcs)):
        fail("--gcs: several vehicles cannot have one port; let them call, by udpout: or tcp:, or fly one")
    for instance in range(spec.instance, spec.instance + spec.count):
        open_link(_plant_url(spec, instance)).close()
    return in_words(without_effect(FlownOptions(spec, name, assumed, vehicle, whole)).items())


def _plant_url(spec: FleetSpec, instance: int) -> str:
    port = PLANT_PORT + instance
    if spec.plant_port is not None:
        port = spec.plant_port + instance - spec.instance if spec.plant_port else 0
    return f"udpin:127.0.0.1:{port}"


def place_of(member: Member, spec: FleetSpec) -> HomePlace:
    """Return a vehicle's home, in a row to the east."""
    home = spec.home
    if not member.east_m:
        return home
    return HomePlace(*geodetic_of((member.east_m, 0.0, 0.0), home.origin)._replace(altitude_m=home.altitude_m), home[3])


def _start_plant(member: Member, spec: FleetSpec) -> None:
    member.boot_unix_us = round(time() * 1e6)
    start = spec.started(Start(psi=place_of(member, spec).yaw_enu_deg))
    own = {
        "link": _plant_url(spec, member.instance),
        "vehicle": spec.plant_vehicle or spec.vehicle or load_profile(spec.profile).simulation.vehicle,
        "start": start._asdict(),
        "seed": spec.seed + member.instance,
        "events": plant_events(spec.events),
    }
    _start(PlantSpec, member, spec, own)


def _start_autopilot(member: Member, spec: FleetSpec) -> None:
    plant, state = member.plant_url.replace("udpin", "udpout"), spec.state / str(member.instance)
    own = {"plant": plant, "gcs": tuple(member.links), "state": state, "events": station_events(spec.events)}
    _start(AutopilotSpec, member, spec, own)


def _start(kind: type[PlantSpec | AutopilotSpec], member: Member, spec: FleetSpec, own: dict[str, Any]) -> None:
    own |= {"home": place_of(member, spec), "system_id": member.instance + 1, "boot_unix_us": member.boot_unix_us}
    member.children.append(Child(part_of(spec, kind, **own, out=spec.folder(member.instance), tlog=True)))


def _watch(fleet: Sequence[Member], spec: FleetSpec, stop: Stop, lines: StatusLines) -> None:
    flying = list(fleet)
    while flying and not stop:
        codes = {member: [child.code() for child in member.children] for member in flying}
        _hear(flying, spec, lines)
        lines.show(perf_counter())
        for member, of_children in codes.items():
            if 0 in of_children:  # its time is over, or a ground station has shut it down
                end_children(reversed(member.children))
                lines.forget(member.instance)
                flying.remove(member)
            elif any(of_children):
                start_again(member, spec, lines)


def _hear(fleet: Sequence[Member], spec: FleetSpec, lines: StatusLines) -> None:
    members = {child: member for member in fleet for child in member.children}
    for child, event in events_of(members):
        member = members[child]
        match event["event"]:
            case "listening" if child.name == "plant":
                member.plant_url = event["url"]
                _start_autopilot(member, spec)
            case "ground":
                member.links[event["link"]] = event["url"]
            case "status":
                event["position_enu_m"][0] += member.east_m
        lines.add(member.instance, child.name, event)


def start_again(member: Member, spec: FleetSpec, lines: StatusLines) -> None:
    """Restart a dead autopilot, or both after the plant's death."""
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
        folder = spec.folder(member.instance)
        if folder is not None:
            set_aside(*(folder / name for name in LOGS))
        member.children.clear()
        _start_plant(member, spec)
    else:
        end_children([child])
        member.children.remove(child)
        _start_autopilot(member, spec)
