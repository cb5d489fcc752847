"""The setpoint sources: companions, a pilot's sticks, and the target to follow."""

from dataclasses import dataclass

from colibri.mavlink.node.service import Peer
from colibri.mavlink.setpoints.follow_target import Follow
from colibri.mavlink.setpoints.manual_control import Manual
from colibri.mavlink.setpoints.offboard import Offboard
from colibri.mavlink.telemetry.snapshot import Snapshot


@dataclass(frozen=True, slots=True)
class SetpointSources:
    """Services that receive setpoints.

    Attributes:
        offboard: Setpoints of companions.
        manual: Sticks of a pilot.
        follow: The target to follow.
    """

    offboard: Offboard
    manual: Manual
    follow: Follow

    def engage(self, peer: Peer, now_us: int) -> None:
        """Let `peer`, which requests a mode that is steered, be the one that steers."""
        for service in (self.offboard, self.manual, self.follow):
            service.engage(peer, now_us)

    def update(self, snapshot: Snapshot, yaw_rad: float) -> None:
        """Take in the vehicle's state, from which setpoints are measured."""
        self.offboard.update(snapshot.position_enu_m, yaw_rad, snapshot.origin, snapshot.home)
        self.follow.update(snapshot.origin)
