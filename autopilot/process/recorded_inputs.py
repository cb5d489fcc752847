"""What an autopilot was started with and received: enough to replay a recorded flight."""

from collections.abc import Iterable
from typing import NamedTuple, TypeAlias

import msgspec

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.errors import AutopilotError
from colibri.autopilot.spec import AutopilotSpec, name_of
from colibri.common.earth.geodesy import Geodetic
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.parameters.store import Value
from colibri.mavlink.ulog.inputs import InputRecord, Kind
from colibri.plant.vehicle.description import Vehicle


class InputsError(AutopilotError):
    """A log has no such inputs; the message is the one line that a user needs."""


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


def setup_of(spec: AutopilotSpec, profile: Profile, vehicle: Vehicle, track_file: str | None) -> Setup:
    """Return the record of how an autopilot begins; `track_file` is the text of its track's file."""
    return Setup(
        profile=name_of(spec.profile),
        controller=profile.controller,
        solver=spec.solver,
        delay_s=spec.delay_s,
        vehicle=name_of(spec.vehicle or profile.simulation.vehicle),
        feedback=spec.feedback,
        track=spec.flown,
        floor_m=spec.floor,
        origin=spec.home.origin,
        boot_unix_us=spec.boot_unix_us,
        system_id=spec.system_id,
        identity=spec.identity,
        ground=spec.served,
        profile_tables=profile,
        vehicle_tables=vehicle,
        track_file=track_file,
    )


class ReceivedDatagram(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="heard", tag_field="what"
):
    """A datagram of a ground station.

    Attributes:
        link: Number of the link.
        address: Where from.
        loopback: Whether from this computer.
        datagram: The bytes; in base 64 in the log.
    """

    link: int
    address: tuple[str, int] | None
    loopback: bool
    datagram: bytes


Input: TypeAlias = Setup | ReceivedDatagram
_DECODER = msgspec.json.Decoder(Input)


def encoded(what: Input) -> bytes:
    """Return an input as JSON."""
    return msgspec.json.encode(what)


class Inputs(NamedTuple):
    """What an autopilot received in a flight.

    Attributes:
        setups: How it began, by the first frame that it answered; a restart in flight is another beginning.
        datagrams: What ground stations sent, by the frame after which it was served.
        frames: Datagrams of the plant, by their frames.
    """

    setups: dict[int, Setup]
    datagrams: dict[int, list[ReceivedDatagram]]
    frames: dict[int, bytes]


def read_inputs(records: Iterable[InputRecord]) -> Inputs:
    """Return the inputs of a log.

    Raises:
        InputsError: A record is none of these, or the autopilot never began.
    """
    inputs = Inputs({}, {}, {})
    for time_us, kind, content in records:
        if kind == Kind.FRAME:
            inputs.frames.setdefault(time_us, content)
            continue
        try:
            what = _DECODER.decode(content)
        except msgspec.MsgspecError as error:
            raise InputsError(f"input at t = {time_us * 1e-6:.3f} s: {error}") from error
        if isinstance(what, Setup):
            inputs.setups[time_us] = what
        else:
            inputs.datagrams.setdefault(time_us, []).append(what)
    if not inputs.setups:
        raise InputsError("no autopilot has begun in it")
    return inputs
