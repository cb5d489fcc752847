"""The vehicle side of MAVLink: codec, links, and the conversations as state machines without input or output."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.mavlink.errors import MavlinkError
    from colibri.mavlink.hil.feedback import Feedback
    from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
    from colibri.mavlink.hil.lockstep_plant import PlantEnd
    from colibri.mavlink.hil.sensors import SensorFrame
    from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
    from colibri.mavlink.links.link import GroundLink, LinkError
    from colibri.mavlink.links.open import open_ground_link, open_link
    from colibri.mavlink.links.udp import UdpLink
    from colibri.mavlink.mission.items import MissionItem
    from colibri.mavlink.node.hub import Hub
    from colibri.mavlink.node.service import Service
    from colibri.mavlink.parameters.store import Parameter, Parameters
    from colibri.mavlink.wire.dialect import Codec, Message
    from colibri.mavlink.wire.tlog import TlogError, TlogWriter
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "colibri.mavlink.errors": "MavlinkError",
            "colibri.mavlink.hil.feedback": "Feedback",
            "colibri.mavlink.hil.lockstep_autopilot": "AutopilotEnd",
            "colibri.mavlink.hil.lockstep_plant": "PlantEnd",
            "colibri.mavlink.hil.sensors": "SensorFrame",
            "colibri.mavlink.hil.state": "ActuatorCommand StateFrame",
            "colibri.mavlink.links.link": "GroundLink LinkError",
            "colibri.mavlink.links.open": "open_ground_link open_link",
            "colibri.mavlink.links.udp": "UdpLink",
            "colibri.mavlink.mission.items": "MissionItem",
            "colibri.mavlink.node.hub": "Hub",
            "colibri.mavlink.node.service": "Service",
            "colibri.mavlink.parameters.store": "Parameter Parameters",
            "colibri.mavlink.wire.dialect": "Codec Message",
            "colibri.mavlink.wire.tlog": "TlogError TlogWriter",
        },
    )

__all__ = [
    "ActuatorCommand",
    "AutopilotEnd",
    "Codec",
    "Feedback",
    "GroundLink",
    "Hub",
    "LinkError",
    "MavlinkError",
    "Message",
    "MissionItem",
    "Parameter",
    "Parameters",
    "PlantEnd",
    "SensorFrame",
    "Service",
    "StateFrame",
    "TlogError",
    "TlogWriter",
    "UdpLink",
    "open_ground_link",
    "open_link",
]
