"""MAVLink: codec, links, and the protocols of vehicle and client as state machines without I/O."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.mavlink.client.client import Client as Client
    from colibri.mavlink.client.commands import Command as Command
    from colibri.mavlink.client.commands import CommandInt as CommandInt
    from colibri.mavlink.client.parameters import ListParameters as ListParameters
    from colibri.mavlink.client.parameters import ReadParameter as ReadParameter
    from colibri.mavlink.client.parameters import SetParameter as SetParameter
    from colibri.mavlink.client.plans import Download as Download
    from colibri.mavlink.client.plans import Upload as Upload
    from colibri.mavlink.errors import MavlinkError as MavlinkError
    from colibri.mavlink.hil.feedback import Feedback as Feedback
    from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd as AutopilotEnd
    from colibri.mavlink.hil.lockstep_plant import PlantEnd as PlantEnd
    from colibri.mavlink.hil.sensors import SensorFrame as SensorFrame
    from colibri.mavlink.hil.state import ActuatorCommand as ActuatorCommand
    from colibri.mavlink.hil.state import StateFrame as StateFrame
    from colibri.mavlink.links.link import GroundLink as GroundLink
    from colibri.mavlink.links.link import LinkError as LinkError
    from colibri.mavlink.links.open import open_ground_link as open_ground_link
    from colibri.mavlink.links.open import open_link as open_link
    from colibri.mavlink.links.udp import UdpLink as UdpLink
    from colibri.mavlink.mission.items import MissionItem as MissionItem
    from colibri.mavlink.node.hub import Hub as Hub
    from colibri.mavlink.node.service import Service as Service
    from colibri.mavlink.parameters.store import Parameter as Parameter
    from colibri.mavlink.parameters.store import Parameters as Parameters
    from colibri.mavlink.wire.dialect import Codec as Codec
    from colibri.mavlink.wire.dialect import Message as Message
    from colibri.mavlink.wire.tlog import TlogError as TlogError
    from colibri.mavlink.wire.tlog import TlogWriter as TlogWriter
else:
    __getattr__, __dir__ = public(__name__)
