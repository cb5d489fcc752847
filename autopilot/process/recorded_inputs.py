"""What an autopilot was started with and received, beside the plant's frames: enough to fly a recorded flight again.

A log of lines of JSON: how it began, then each datagram of a ground station with the frame after which it was served.
One that was restarted in mid-flight has another beginning in it.
"""

from collections.abc import Iterable
from typing import TypeAlias

import msgspec

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.errors import AutopilotError
from colibri.common.earth.geodesy import Geodetic
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.parameters.store import Value
from colibri.plant.vehicle.description import Vehicle


class InputsError(AutopilotError):
    """A file is no such log; the message names the line."""


class Setup(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="began", tag_field="what"):
    """How an autopilot began.

    Attributes:
        profile: Name or file.
        controller: Of the profile's control laws.
        solver: QP solver chosen; None for the profile's.
        delay_s: Delay chosen; None for the profile's.
        vehicle: That it controls, name or file.
        feedback: Kind of the frames, states or sensors.
        track: What it flew from the start; None where ground stations say what to fly.
        floor_m: Below which no track might lead; None for the ground of the vehicle.
        origin: Of the ENU frame.
        boot_unix_us: Unix time at simulated time 0, which dates the telemetry log; 0 where it has simulated time.
        system_id: MAVLink system.
        identity: Towards ground stations.
        ground: Whether it served ground stations.
        values: Of parameters that were changed before.
        history: What had been kept of the same flight, where it was killed in it; else empty.
        first_us: The first frame that it answered.
        profile_tables: What was in the profile; None in logs of before it was kept.
        vehicle_tables: What was in the vehicle's file; None as well.
        track_file: What was in the file that the track names, if it names one.
    """

    profile: str
    controller: str
    solver: str | None
    delay_s: float | None = None
    vehicle: str
    feedback: Feedback
    track: str | None
    floor_m: float | None = None
    origin: Geodetic
    boot_unix_us: int = 0
    system_id: int
    identity: str
    ground: bool
    values: dict[str, Value] = {}
    history: bytes = b""
    first_us: int = 0
    profile_tables: Profile | None = None
    vehicle_tables: Vehicle | None = None
    track_file: str | None = None


class ReceivedDatagram(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="heard", tag_field="what"
):
    """A datagram of a ground station.

    Attributes:
        time_us: Of the frame after which it was served.
        link: Number of the link.
        address: Where from.
        loopback: Whether from this computer.
        datagram: The bytes; in base 64 in the log.
    """

    time_us: int
    link: int
    address: tuple[str, int] | None
    loopback: bool
    datagram: bytes


Input: TypeAlias = Setup | ReceivedDatagram
_DECODER = msgspec.json.Decoder(Input)


def line(what: Input) -> bytes:
    """Return a line of the log."""
    return msgspec.json.encode(what) + b"\n"


def read(log: bytes) -> list[Input]:
    """Return the inputs of the last flight of a log; of a process that was killed, the last line may be cut off.

    Raises:
        InputsError: This is no such log.
    """
    *lines, _ = log.split(b"\n")
    inputs: list[Input] = []
    for number, text in enumerate(lines, 1):
        try:
            what = _DECODER.decode(text)
        except msgspec.MsgspecError as error:
            raise InputsError(f"line {number}: {error}") from error
        if isinstance(what, Setup) and what.first_us <= max(_beginnings(inputs), default=-1):
            inputs.clear()  # of a flight before
        inputs.append(what)
    if not _beginnings(inputs):
        raise InputsError("nothing has begun")
    return inputs


def _beginnings(inputs: Iterable[Input]) -> list[int]:
    return [what.first_us for what in inputs if isinstance(what, Setup)]
