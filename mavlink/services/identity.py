"""The autopilot's identity: its conventions on the wire, to which ground stations adapt."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from colibri.mavlink.node.service import Fields
from colibri.mavlink.wire.dialect import bits, mav

IdentityName: TypeAlias = Literal["px4", "ardupilot", "generic"]
Triple = tuple[int, int, int]

PRODUCT = b"Colibri"
UID2_BYTES = 18

CAPABILITIES = bits(
    "MAV_PROTOCOL_CAPABILITY_",
    "MISSION_INT COMMAND_INT PARAM_ENCODE_BYTEWISE FTP SET_ATTITUDE_TARGET SET_POSITION_TARGET_LOCAL_NED "
    "SET_POSITION_TARGET_GLOBAL_INT FLIGHT_TERMINATION MAVLINK2 MISSION_FENCE MISSION_RALLY",
)


COPTER_CAPABILITIES = (CAPABILITIES & ~mav.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE) | bits(
    "MAV_PROTOCOL_CAPABILITY_", "MISSION_FLOAT PARAM_FLOAT COMPASS_CALIBRATION"
)


@dataclass(frozen=True, slots=True)
class Identity:
    name: str
    autopilot: int  # MAV_AUTOPILOT
    product: str = ""  # name of the emulated program in texts; empty without one
    speaks: Triple | None = None  # release of the emulated interface
    capabilities: int = CAPABILITIES
    commit: bytes | None = None  # AUTOPILOT_VERSION.flight_custom_version: eight hexadecimal digits, as clients parse
    stands_by: bool = False  # armed on the ground is MAV_STATE_STANDBY, and every failsafe CRITICAL
    acknowledges_mode: bool = False  # SET_MODE is answered by COMMAND_ACK
    numbers_as_floats: bool = False  # PARAM_VALUE has every number as a float; unknown names are not answered
    home_first: bool = False  # item 0 of a mission is home
    streams_current: bool = True  # MISSION_CURRENT is sent unasked
    old_form_first: bool = False  # items are requested by MISSION_REQUEST first


PX4 = Identity("px4", mav.MAV_AUTOPILOT_PX4, "PX4", speaks=(1, 15, 0))
GENERIC = Identity("generic", mav.MAV_AUTOPILOT_GENERIC)
ARDUPILOT = Identity(
    "ardupilot",
    mav.MAV_AUTOPILOT_ARDUPILOTMEGA,
    "ArduPilot",
    speaks=(4, 6, 0),
    capabilities=COPTER_CAPABILITIES,
    commit=b"c0118121",
    stands_by=True,
    acknowledges_mode=True,
    numbers_as_floats=True,
    home_first=True,
    streams_current=False,
    old_form_first=True,
)


def version_of(text: str) -> Triple:
    """Return three numbers of a version like "0.2.1"; zeros if missing or not numeric."""
    numbers = [int(part) & 0xFF if part.isdecimal() else 0 for part in text.split(".")[:3]]
    major, minor, patch = (*numbers, 0, 0, 0)[:3]
    return (major, minor, patch)


def autopilot_version(identity: Identity, version: Triple, system_id: int) -> Fields:
    """Return AUTOPILOT_VERSION (148), never marked as official: ground stations would offer an update."""
    major, minor, patch = version
    own = _packed(version)
    custom = (patch, minor, major, *PRODUCT[:5])
    flight = custom if identity.commit is None else tuple(identity.commit)
    uid2 = (*PRODUCT, *(0,) * (UID2_BYTES - len(PRODUCT) - 1), system_id)
    shown = own if identity.speaks is None else _packed(identity.speaks)
    return (identity.capabilities, shown, own, 0, 0, flight, custom, (0,) * 8, 0, 0, system_id, uid2)


def banner(identity: Identity, version: str) -> str:
    spoken = "" if identity.speaks is None else f", speaking as {identity.product}"
    return f"Colibri {version}{spoken}"


def _packed(version: Triple) -> int:
    major, minor, patch = version
    kind: int = mav.FIRMWARE_VERSION_TYPE_DEV
    return major << 24 | minor << 16 | patch << 8 | kind
