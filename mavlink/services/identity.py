"""The autopilot's identity.

Ground stations adapt to MAV_AUTOPILOT. As `px4` they offer all features of a PX4, whose custom modes Colibri follows;
as `generic` only common ones. Either way AUTOPILOT_VERSION and the text at the start name Colibri.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from colibri.mavlink.node.service import Fields
from colibri.mavlink.wire.dialect import bits, mav

IdentityName: TypeAlias = Literal["px4", "generic"]
Triple = tuple[int, int, int]

PRODUCT = b"Colibri"
UID2_BYTES = 18

CAPABILITIES = bits(
    "MAV_PROTOCOL_CAPABILITY_",
    "MISSION_INT COMMAND_INT PARAM_ENCODE_BYTEWISE FTP SET_ATTITUDE_TARGET SET_POSITION_TARGET_LOCAL_NED "
    "SET_POSITION_TARGET_GLOBAL_INT FLIGHT_TERMINATION MAVLINK2 MISSION_FENCE MISSION_RALLY",
)


@dataclass(frozen=True, slots=True)
class Identity:
    """An identity.

    Attributes:
        autopilot: MAV_AUTOPILOT.
        product: Name of the emulated program in texts; empty without one.
        speaks: Release of the emulated interface.
    """

    name: str
    autopilot: int
    product: str = ""
    speaks: Triple | None = None
    capabilities: int = CAPABILITIES


PX4 = Identity("px4", mav.MAV_AUTOPILOT_PX4, "PX4", speaks=(1, 15, 0))
GENERIC = Identity("generic", mav.MAV_AUTOPILOT_GENERIC)
IDENTITIES = {identity.name: identity for identity in (PX4, GENERIC)}


def version_of(text: str) -> Triple:
    """Return three numbers of a version like "0.2.1"; zeros if missing or not numeric."""
    numbers = [int(part) & 0xFF if part.isdecimal() else 0 for part in text.split(".")[:3]]
    major, minor, patch = (*numbers, 0, 0, 0)[:3]
    return (major, minor, patch)


def autopilot_version(identity: Identity, version: Triple, system_id: int) -> Fields:
    """Return the fields of AUTOPILOT_VERSION (148).

    Versions are never marked as official: ground stations would offer an update to PX4's latest.
    """
    major, minor, patch = version
    own = _packed(version)
    custom = (patch, minor, major, *PRODUCT[:5])
    uid2 = (*PRODUCT, *(0,) * (UID2_BYTES - len(PRODUCT) - 1), system_id)
    shown = own if identity.speaks is None else _packed(identity.speaks)
    return (identity.capabilities, shown, own, 0, 0, custom, custom, (0,) * 8, 0, 0, system_id, uid2)


def banner(identity: Identity, version: str) -> str:
    spoken = "" if identity.speaks is None else f", speaking as {identity.product}"
    return f"Colibri {version}{spoken}"


def _packed(version: Triple) -> int:
    major, minor, patch = version
    kind: int = mav.FIRMWARE_VERSION_TYPE_DEV
    return major << 24 | minor << 16 | patch << 8 | kind
