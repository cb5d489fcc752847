"""Needs of flight modes, and the latest client inputs."""

from colibri.autopilot.commander.missions import Missions
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.modes import Mode, Need
from colibri.autopilot.guidance.tasks.task import ClientInputs
from colibri.mavlink.node.service import Peer
from colibri.mavlink.setpoints.follow_target import Follow
from colibri.mavlink.setpoints.manual_control import Manual
from colibri.mavlink.setpoints.offboard import Offboard

_TARGET_LOST_US = 10_000_000


class ModeNeeds:
    def __init__(
        self,
        pilot: Pilot,
        missions: Missions,
        manual: Manual,
        offboard: Offboard,
        follow: Follow,
        *,
        takes_attitude: bool,
    ) -> None:
        self._pilot, self._missions = pilot, missions
        self._manual, self._offboard, self._follow = manual, offboard, follow
        self._takes_attitude = takes_attitude
        self._now_us = 0

    def at(self, now_us: int) -> None:
        self._now_us = now_us

    def engage(self, peer: Peer, now_us: int) -> None:
        """Make `peer` the steering client."""
        for service in (self._offboard, self._manual, self._follow):
            service.engage(peer, now_us)

    def missing(self) -> dict[Need, str]:
        """Return the unmet needs, each with its reason."""
        steered = self.steered(self._now_us)
        met = {
            Need.ATTITUDE_CONTROL: self._takes_attitude,
            Need.STICKS: steered.sticks is not None,
            Need.SETPOINTS: steered.setpoint is not None,
            Need.MISSION: self._missions.total > 0,
            Need.CHECKED: not self._missions.checking,
            Need.CIRCLE: False,
            Need.FLYING: not self._pilot.ground.standing,
            Need.POSITION: self._pilot.sensed.position_known,
        }
        refused = {
            Need.STICKS: self._manual.refusal(self._now_us),
            Need.SETPOINTS: self._offboard.refusal(self._now_us),
        }
        unmet = {need: refused.get(need) or need.value for need, there in met.items() if not there}
        return unmet | self._missions.unmet

    def remark(self, mode: Mode) -> str:
        """Return what a mode waits for, or an empty text."""
        if mode is not Mode.FOLLOW or self.steered(self._now_us).followed is not None:
            return ""
        return self._follow.refusal(self._now_us) or "follow: holds until a FOLLOW_TARGET is received"

    def steered(self, now_us: int) -> ClientInputs:
        behaviour = self._pilot.behaviour
        return ClientInputs(
            self._manual.latest(now_us, round(behaviour.sticks_lost_s * 1e6)),
            self._offboard.latest(now_us, round(behaviour.setpoints_lost_s * 1e6)),
            self._follow.latest(now_us, _TARGET_LOST_US),
            self._manual.held,
        )
