"""The golden flights, sensitive to a single bit.

Flights that saturate, tumble or use noisy sensors amplify one bit within a second, and find a difference. Others show
where it matters.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from colibri.analysis.outcome import keep_flight
from colibri.autopilot.commander.rules.modes import Mode
from colibri.flights.fly import fly_plan
from colibri.flights.folder import prepare
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec
from colibri.mavlink.hil.feedback import Feedback
from colibri.sitl.backends.setting import setting_of

if TYPE_CHECKING:
    from colibri.sitl.vehicle import Sitl

_WAYPOINTS_FILE = "waypoints.csv"


class TrackCase(NamedTuple):
    """A flight along a track, by options of `colibri fly`."""

    name: str
    options: dict[str, Any]
    waypoints: str = ""

    def plan(self, out: Path, **more: Any) -> FlightPlan:
        track = {"track": f"waypoints:{out / _WAYPOINTS_FILE}"} if self.waypoints else {}
        return FlightPlan.of(FlightSpec.of(**(self.options | track | {"out": out} | more)))

    def fly(self, out: Path, link: str, **more: Any) -> str:
        """Return the hash of the trajectory; logs are in `out`."""
        prepare(out)
        if self.waypoints:
            (out / _WAYPOINTS_FILE).write_text(self.waypoints, encoding="utf-8")
        plan = self.plan(out, **more, link=link)
        figures = keep_flight(plan, fly_plan(plan))
        sha256: str = figures["trajectory_sha256"]
        return sha256


class SitlCase(NamedTuple):
    """A flight commanded by a ground station, by keys of `Setting`."""

    name: str
    orders: "Callable[[Sitl], object]"
    setting: Mapping[str, Any] = {}

    def fly(self, out: Path, link: str) -> str:
        """Return the hash of all truth and commands; logs are in `out`."""
        from colibri.sitl.backends.launcher import Launcher
        from colibri.sitl.session import Flights

        begun = Launcher(from_scratch=True) if link == "udp" else None
        with Flights(setting_of([self.setting]), begun) as flights:
            try:
                sitl = flights.begin()
                self.orders(sitl)
            finally:
                flights.keep(out, figures=False)
        return sitl.sha256


SHOWN = 16  # characters of a hash in tables


GUSTS: dict[str, Any] = {"wind": "8@270", "turbulence": "moderate", "seed": 7}
SENSORS: dict[str, Any] = {"feedback": Feedback.SENSORS, "seed": 7}
TUMBLING = {"x": 0.0, "y": 0.0, "z": 20.0, "phi": 170.0, "p": 6.0, "q": -6.0, "r": 5.0}
UPSIDE_DOWN = {"x": 0.0, "y": 0.0, "z": 20.0, "phi": 180.0}
WAYPOINTS = "x,y,z,t,yaw\n0,0,1,0,0\n3,0,2,2,90\n3,4,2,4,180\n0,0,1,7,270\n"
TRACKS = ("spiral", "expanding-spiral", "line", "wave", "crown")


def _flown(name: str, track: str, duration: float, profile: str = "flight", **options: Any) -> TrackCase:
    return TrackCase(name, {"track": track, "profile": profile, "duration": duration, **options})


def _on_sensors(turbulence: str, seed: int) -> dict[str, Any]:
    return {"feedback": "sensors", "wind": "5@270", "turbulence": turbulence, "seed": seed}


def _mission(sitl: "Sitl") -> None:
    first, last = sitl.items.waypoint(8.0, 0.0, 4.0), sitl.items.waypoint(8.0, 12.0, 5.0, stay_s=0.5)
    plan = [sitl.items.takeoff(4.0), first, sitl.items.change_speed(8.0), last, sitl.items.land(4.0, 6.0)]
    sitl.upload_mission(plan)
    sitl.start_mission()
    sitl.wait_until(lambda: not sitl.armed, within=60.0, what="the landing")


def _rotor_lost(sitl: "Sitl") -> None:
    sitl.goto(30.0, 0.0, 12.0, speed=6.0, wait=False)
    sitl.run(2.0)
    sitl.inject("motor", "off", 2)
    sitl.run(6.0)


def _rotor_lost_on_sensors(sitl: "Sitl") -> None:
    sitl.takeoff(6.0, wait=False)
    sitl.wait_until(lambda: sitl.mode is Mode.HOLD and sitl.position[2] > 5.4, within=17.0, what="the climb")
    sitl.inject("motor", "off", 4)
    sitl.wait_until(lambda: not sitl.armed, within=30.0, what="the landing")


def _restarted(sitl: "Sitl") -> None:
    sitl.goto(12.0, 9.0, 8.0, speed=6.0, wait=False)
    sitl.run(2.5)
    sitl.kill_autopilot()
    sitl.run(4.0)


def _sticks(sitl: "Sitl") -> None:
    with sitl.sticks_held(pitch=0.7, roll=-0.4, thrust=0.6, yaw=0.3):
        sitl.run(0.2)
        sitl.select(Mode.STABILIZED)
        sitl.run(1.5)
        sitl.select(Mode.POSITION)
        sitl.run(1.5)
    sitl.select(Mode.RETURN)
    sitl.run(3.0)


FLIGHTS: tuple[TrackCase | SitlCase, ...] = (
    # Beyond what the vehicle can do, and back from where no flight should be.
    _flown("beyond-its-limits", "lemniscate:lap=1.0", 40.0),
    _flown("at-its-limits-in-gusts", "lemniscate:lap=4.0", 20.0, **GUSTS),
    _flown("tumbling", "hover:height=20", 5.0, start=TUMBLING),
    _flown("upside-down-in-gusts", "hover:height=20", 5.0, start=UPSIDE_DOWN, **GUSTS),
    # By sensors, in turbulence.
    _flown("lemniscate-on-sensors", "lemniscate", 20.0, **GUSTS, feedback=Feedback.SENSORS),
    _flown("hover-on-rtk", "hover", 8.0, vehicle="hummingbird-rtk", **SENSORS),
    _flown("wave-late-on-sensors", "wave", 8.0, latency=8.0, **SENSORS),
    # What the plant and the planner have beside.
    _flown("lemniscate-adaptive", "lemniscate", 5.0, integrator="adaptive", wind="5@270"),
    TrackCase("waypoints", {"track": "waypoints", "profile": "flight", "duration": 9.0}, WAYPOINTS),
    # Every control law.
    _flown("circle-by-se3", "circle:radius=3,speed=4", 6.0, "se3", **GUSTS),
    _flown("tumbling-by-se3", "hover:height=20", 5.0, "se3", start=TUMBLING),
    _flown("wave-by-global-lpv-mpc", "wave", 20.0, "thesis", controller="global-lpv-mpc"),
    _flown("thesis-euler-crown", "crown", 20.0, "thesis-euler"),
    _flown("thesis-lemniscate-lost", "lemniscate", 10.0, "thesis"),
    # Every track of the thesis.
    *(_flown(f"thesis-{track}", track, 20.0, "thesis") for track in TRACKS),
    *(_flown(track, track, 6.0) for track in TRACKS),
    # By orders of a ground station.
    SitlCase("mission", _mission),
    SitlCase("mission-on-sensors", _mission, _on_sensors("light", 4)),
    SitlCase("rotor-lost", _rotor_lost, {"airborne": 12.0, "wind": "5@200", "turbulence": "light"}),
    SitlCase("rotor-lost-on-sensors", _rotor_lost_on_sensors, _on_sensors("moderate", 3)),
    SitlCase("autopilot-restarted", _restarted, {"airborne": 8.0}),
    SitlCase("sticks-by-se3", _sticks, {"airborne": 8.0, "controller": "geometric-se3", "wind": "5@90"}),
)
