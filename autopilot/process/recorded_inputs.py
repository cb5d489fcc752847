"""Setup and inputs of an autopilot, for the replay of a flight."""

from collections.abc import Iterable
from typing import NamedTuple, TypeAlias

import msgspec

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.errors import AutopilotError
from colibri.autopilot.spec import AutopilotSpec, name_of
from colibri.common.config import UNREADABLE
from colibri.common.earth.geodesy import Geodetic
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.parameters.store import Value
from colibri.mavlink.ulog.inputs import InputRecord, RecordKind
from colibri.plant.vehicle.description import Vehicle


class InputsError(AutopilotError):
    """A log without inputs; the message is for the user."""


class Setup(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag="began", tag_field="what"):
    """Setup of an autopilot; names or files, as chosen.

    Attributes:
        solver, delay_s: Replace the profile's.
    """

    profile: str
    controller: str
    solver: str | None
    delay_s: float | None = None
    vehicle: str
    feedback: Feedback
    track: str | None
    floor_m: float | None = None  # by default the ground
    origin: Geodetic
    boot_unix_us: int = 0  # 0 for simulated time
    system_id: int
    identity: str
    ground: bool
    values: dict[str, Value] = {}
    history: bytes = b""  # saved state of the flight, after a kill
    first_us: int = 0  # first answered frame
    profile_tables: Profile
    vehicle_tables: Vehicle
    track_file: str | None = None


def setup_of(spec: AutopilotSpec, profile: Profile, vehicle: Vehicle, track_file: str | None) -> Setup:
    return Setup(
        profile=name_of(spec.profile),
        controller=profile.controller,
        solver=spec.solver,
        delay_s=spec.delay_s,
        vehicle=name_of(spec.vehicle or profile.simulation.vehicle),
        feedback=spec.feedback,
        track=None if spec.flown is None else str(spec.flown),
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
    """A datagram of a ground station; base 64 in the log."""

    link: int
    address: tuple[str, int] | None
    loopback: bool
    datagram: bytes


Input: TypeAlias = Setup | ReceivedDatagram
_DECODER = msgspec.json.Decoder(Input)


class RecordedInputs(NamedTuple):
    """Inputs by the time of a frame; several setups after restarts."""

    setups: dict[int, Setup]
    datagrams: dict[int, list[ReceivedDatagram]]
    frames: dict[int, bytes]


def read_inputs(records: Iterable[InputRecord]) -> RecordedInputs:
    """Return the inputs of a log, or raise InputsError."""
    inputs = RecordedInputs({}, {}, {})
    for time_us, kind, content in records:
        if kind == RecordKind.FRAME:
            inputs.frames.setdefault(time_us, content)
            continue
        try:
            what = _DECODER.decode(content)
        except UNREADABLE as error:
            raise InputsError(f"input at t = {time_us * 1e-6:.3f} s: {error}") from error
        if isinstance(what, Setup):
            inputs.setups[time_us] = what
        else:
            inputs.datagrams.setdefault(time_us, []).append(what)
    if not inputs.setups:
        raise InputsError("no autopilot has begun in it")
    return inputs
