"""The commander without a flight: its parts, around a vehicle that is always where its reference is."""

from math import nan
from typing import Any

import numpy as np

from colibri.autopilot.commander.commands import Commanded, Commands
from colibri.autopilot.commander.fence import Fence
from colibri.autopilot.commander.home import Home
from colibri.autopilot.commander.missions import Missions
from colibri.autopilot.commander.mode_tasks import ModeTasks
from colibri.autopilot.commander.pilot import Pilot, Sensed
from colibri.autopilot.commander.rules.arming import ArmingInputs
from colibri.autopilot.commander.rules.modes import Mode, Need
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.control.interface import Preview, VehicleState
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.attitude_reference import AttitudeReference
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.guidance import RESTS, Guidance, instants
from colibri.autopilot.guidance.tasks.task import NOT_STEERED, ClientInputs
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic, geodetic_of
from colibri.common.types import Vector
from colibri.mavlink.mission.items import MissionItem, plan_of
from colibri.mavlink.node.budget import Budget
from colibri.mavlink.node.service import Peer
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.services.command import ACCEPTED, ReceivedCommand
from colibri.mavlink.wire.dialect import Refusal, mav
from colibri.plant.vehicle.description import load_vehicle
from colibri.sitl.mission_items import Item

PREVIEW = Preview(20_000, 5)
GROUND = Peer(0, 255, 190)
STANDING: Vector = (0.0, 0.0, 0.0)
FLYING: Vector = (0.0, 0.0, 10.0)
_NOTHING: Vector = (0.0, 0.0, 0.0)


def at(position: Vector, velocity: Vector = _NOTHING, yaw_rad: float = 0.0) -> VehicleState:
    attitude = (float(np.cos(0.5 * yaw_rad)), 0.0, 0.0, float(np.sin(0.5 * yaw_rad)))
    return VehicleState(position, velocity, attitude, (0.0, 0.0, yaw_rad), _NOTHING)


def item(command: str, *params: float, place: Vector | None = None) -> MissionItem:
    return Item(getattr(mav, f"MAV_CMD_{command}"), params, place).on_wire(DEFAULT_ORIGIN)


class Cockpit:
    """The parts of the commander, and a vehicle that follows every reference exactly."""

    def __init__(
        self,
        place: Vector = STANDING,
        *,
        behaviour: Behaviour | None = None,
        takes_attitude: bool = True,
        first: Track | None = None,
        mode: Mode | None = None,
    ) -> None:
        """Begin at a place; in the air in hold, or in `mode`."""
        behaviour = behaviour or Behaviour()
        vehicle, planned_at = load_vehicle("hummingbird"), instants(PREVIEW, PREVIEW.interval_us)
        self.home, self.lines = Home(DEFAULT_ORIGIN), StatusQueue()
        self.fence = Fence(self.home, behaviour, Budget())
        self.missions = Missions(self.home, self.fence, self.lines, behaviour)
        attitude = AttitudeReference(vehicle, PREVIEW) if takes_attitude else None
        references = load_profile("flight").references
        self.tasks = ModeTasks(self.missions, attitude, vehicle, PREVIEW, planned_at, references, first, Budget())
        self.pilot = Pilot(planned_at, behaviour, self.tasks.begin, self.home, self.lines)
        self.unmet: tuple[Need, ...] = (Need.CIRCLE,)
        self.engaged: list[tuple[Peer, int]] = []
        needs: Any = self
        self.commands = Commands(Commanded(self.pilot, self.fence, self.missions, needs, self.tasks, Parameters(())))
        self.now_us = 0
        self.state = at(place)
        self.steered: ClientInputs = NOT_STEERED
        self.guidance = RESTS
        self.pilot.begin(0, self.state, mode=mode)
        self.stock()

    def missing(self) -> dict[Need, str]:
        return {need: need.value for need in self.unmet}

    def remark(self, mode: Mode) -> str:
        return f"{mode} has no target" if mode is Mode.FOLLOW and self.steered.followed is None else ""

    def engage(self, peer: Peer, now_us: int) -> None:
        self.engaged.append((peer, now_us))

    def step(self, samples: int = 1, *, position_known: bool = True) -> Guidance:
        for _ in range(samples):
            self.now_us += PREVIEW.interval_us
            self.pilot.sense(Sensed(self.now_us, self.state, self.steered, position_known))
            self.guidance = self.pilot.step()
            if self.guidance is not RESTS and self.pilot.generator.reference is not None:
                reference = self.pilot.generator.reference
                motion, heading = reference.motion, reference.heading
                x, y, z = motion[0].tolist()
                vx, vy, vz = motion[1].tolist()
                on_ground = z < 0.0
                velocity = _NOTHING if on_ground else (vx, vy, vz)
                self.state = at((x, y, max(z, 0.0)), velocity, float(heading[0]))
            self.stock()
            self.missions.watch_mode(self.pilot.state.mode)
        return self.guidance

    def fly_for(self, duration_s: float) -> None:
        self.step(round(duration_s * 1e6 / PREVIEW.interval_us))

    def do(self, command: str, *params: float, frame: int | None = None, **places: float) -> Refusal:
        """Obey a command; return why not, or an accepted result. Parameters that are not given are nan."""
        p1, p2, p3, p4 = (*params, *(nan,) * (4 - len(params)))
        number = getattr(mav, f"MAV_CMD_{command}")
        x, y, z = (places.get(axis, nan) for axis in "xyz")
        asked = ReceivedCommand(number, p1, p2, p3, p4, x, y, z, frame, GROUND, self.now_us)
        return self.commands.handlers()[number](asked) or Refusal(result=ACCEPTED)

    def load(self, plan_type: int, *items: MissionItem) -> None:
        self.missions.load(plan_type, plan_of(items))

    def said(self, words: str) -> bool:
        """Whether one of the lines since this was last asked has these words."""
        return any(words in text for _, text in self.lines.take())

    def place(self, east_m: float, north_m: float) -> Geodetic:
        return geodetic_of((east_m, north_m, 0.0), DEFAULT_ORIGIN)

    def stock(self, **changes: Any) -> None:
        """Let the pilot know what arming is judged by: all is well but for `changes`."""
        self.pilot.readiness.inputs = ArmingInputs(self.state, self.pilot.ground.standing, 1.0, None)._replace(
            **changes
        )
