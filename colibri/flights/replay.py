"""`colibri replay`: the frames of a recorded flight, fed to the autopilot alone: is each command what it was?"""

import argparse
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from math import degrees
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from colibri.autopilot.control.profile import Profile, load_profile
from colibri.autopilot.control.registry import DecisionError
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.checkpoint import History
from colibri.autopilot.core.copter import copter_autopilot
from colibri.autopilot.core.step import Received, Step
from colibri.autopilot.core.track_stages import track_autopilot
from colibri.autopilot.estimation.state_source import estimator_for
from colibri.autopilot.ground.stations import StationSettings
from colibri.autopilot.guidance.trajectories.loading import load_track, with_file
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.autopilot.process.recorded_inputs import Input, InputsError, ReceivedDatagram, Setup, read
from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_FAILED, fail
from colibri.common.rotations import euler_from_quaternion
from colibri.common.serialization import of_bytes
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame, decode_actuators, encode_actuators
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Codec
from colibri.mavlink.wire.tlog import Logged, TlogError, decode
from colibri.plant.vehicle.description import Vehicle, load_vehicle

INPUTS, TLOG = "inputs.jsonl", "flight.tlog"
_CUT_OFF_US = 1_000_000
"""Processes that are killed leave logs that end less apart than this."""
_NO_CLOCK_S = 0.0
"""What is decided must not depend on it."""


class Recorded(NamedTuple):
    """A frame of the plant, and the command that answered it.

    Attributes:
        time_us: Simulated time.
        datagram: What the autopilot received.
        command: What it answered; None where nothing of it was recorded.
    """

    time_us: int
    datagram: bytes
    command: ActuatorCommand | None


class Answer(NamedTuple):
    """What the autopilot made of a frame when it was asked again.

    Attributes:
        time_us: Of the frame.
        command: What it had answered; None where nothing of that was recorded.
        autopilot: That answered.
        step: Its answer.
        known: Its state estimate; None before the first estimate.
    """

    time_us: int
    command: ActuatorCommand | None
    autopilot: Autopilot[Any]
    step: Step
    known: StateFrame | None


class Difference(NamedTuple):
    """The first command that is not what it was.

    Attributes:
        recorded: What it was.
        replayed: What it is.
        mode: Of the autopilot, at that moment.
        known: Its state estimate; None before the first estimate.
    """

    recorded: ActuatorCommand
    replayed: ActuatorCommand
    mode: str
    known: StateFrame | None

    def __str__(self) -> str:
        """Return it as lines for a user."""
        return "\n".join(
            (
                f"first difference at t = {self.recorded.time_us * 1e-6:.3f} s, in mode {self.mode}",
                f"  recorded: {_rotors(self.recorded)}",
                f"  replayed: {_rotors(self.replayed)}",
                f"  vehicle:  {_state(self.known)}",
            )
        )


class Replayed(NamedTuple):
    """What came of a replay.

    Attributes:
        commands: How many were compared, up to the difference if there is one.
        last_us: Time of the last of them.
        difference: The first; None if all are what they were.
    """

    commands: int
    last_us: int
    difference: Difference | None


class ReplayError(Error):
    """A recording that cannot be replayed; the message is the one line that a user needs."""


def replay(args: argparse.Namespace) -> int:
    """Replay as the command line says; return the exit code."""
    if args.tlog.is_dir():
        args.tlog /= TLOG
    try:
        outcome = replay_flight(args.tlog)
        ended_us = _logged_us(args.tlog)
    except ReplayError as error:
        fail(str(error))
    if outcome.difference is not None:
        print(outcome.difference)  # noqa: T201
        fail(f"{args.tlog}: the autopilot does not answer as it did, after {outcome.commands} commands", EXIT_FAILED)
    if not args.quiet:
        print(f"{outcome.commands} commands up to t = {outcome.last_us * 1e-6:.3f} s, all identical")  # noqa: T201
        for name in _changed(_inputs(args.tlog.parent / INPUTS, args.tlog)):
            print(f"{name} is another by now: replayed as it flew")  # noqa: T201
    if ended_us - outcome.last_us > _CUT_OFF_US:
        cut = f"ends at t = {outcome.last_us * 1e-6:.3f} s, and the flight went on to t = {ended_us * 1e-6:.3f} s"
        fail(f"{args.tlog} {cut}: it was cut off", EXIT_FAILED)
    return 0


def replay_flight(tlog: Path) -> Replayed:
    """Replay a flight from its telemetry log and the autopilot's log of inputs beside it.

    Profile, vehicle and waypoints are those of the log, whatever their files are by now.

    Raises:
        ReplayError: They cannot be replayed.
    """
    recorded, inputs = _read(tlog)
    try:
        return _compare(recorded, inputs)
    except ReplayError:
        raise
    except Error as error:
        raise ReplayError(f"{tlog.parent / INPUTS}: {error}") from error


def recorded_frames(log: Iterable[Logged], setup: Setup) -> Iterator[Recorded]:
    """Yield each frame of the plant once, in order, with the command that answered it."""
    codec = Codec(setup.system_id, dialect.AUTOPILOT_COMPONENT)
    plant = (setup.system_id, dialect.PLANT_COMPONENT)
    sent: dict[int, dict[bytes, None]] = {}
    commands: dict[int, ActuatorCommand] = {}
    for logged_us, frame in log:
        time_us = logged_us - setup.boot_unix_us
        for message in codec.decode(frame):
            if message.source == plant:
                sent.setdefault(time_us, {})[frame] = None  # once, however often it was sent
            elif message.source == codec.source and message.name == "HIL_ACTUATOR_CONTROLS":
                command = decode_actuators(message)
                if command is not None:
                    commands.setdefault(command.time_us, command)
    for time_us in sorted(sent):
        yield Recorded(time_us, b"".join(sent[time_us]), commands.get(time_us))


def answers_of(tlog: Path) -> Iterator[Answer]:
    """Yield the answers of the autopilot to the frames of a flight, as `replay_flight` reads it, one after the other.

    Raises:
        ReplayError: They cannot be replayed.
    """
    yield from _answers(*_read(tlog))


def _read(tlog: Path) -> tuple[list[Recorded], list[Input]]:
    log = _bytes(tlog)
    inputs = _inputs(tlog.parent / INPUTS, tlog)
    setups = [what for what in inputs if isinstance(what, Setup)]
    try:
        recorded = list(recorded_frames(decode(log), setups[0]))
    except TlogError as error:
        raise ReplayError(f"{tlog}: {error}: expected the flight.tlog of a flight") from error
    if not any(each.command for each in recorded):
        raise ReplayError(f"{tlog}: no frame of {setups[0].feedback} feedback is answered in it: nothing to replay")
    return recorded, inputs


def _compare(recorded: Sequence[Recorded], inputs: Sequence[Input]) -> Replayed:
    """Compare answers with what was commanded, until one differs."""
    codec = Codec(next(what for what in inputs if isinstance(what, Setup)).system_id, dialect.AUTOPILOT_COMPONENT)
    commands = last_us = 0
    for answer in _answers(recorded, inputs):
        if answer.command is not None:
            replayed = _carried(codec, answer.step.command)
            if replayed != answer.command:
                difference = Difference(answer.command, replayed, answer.autopilot.stages.mode, answer.known)
                return Replayed(commands, last_us, difference)
            commands, last_us = commands + 1, answer.time_us
    return Replayed(commands, last_us, None)


def _answers(recorded: Sequence[Recorded], inputs: Sequence[Input]) -> Iterator[Answer]:
    """Answer each frame as the autopilot did that was started last before it."""
    setups = {what.first_us: what for what in inputs if isinstance(what, Setup)}
    inbox: dict[int, list[Received]] = {}
    for what in inputs:
        if isinstance(what, ReceivedDatagram):
            inbox.setdefault(what.time_us, []).append(Received(what.datagram, what.link, what.address, what.loopback))
    autopilot: Autopilot[Any] | None = None
    known: StateFrame | None = None
    for time_us, datagram, command in recorded:
        if time_us in setups:
            autopilot = _begun(setups[time_us])
            end = _end(setups[time_us], autopilot)
        if autopilot is None:
            continue
        received = end.receive(datagram, _NO_CLOCK_S)
        if received is None:
            continue
        frame = received.frame
        try:
            step = autopilot.step(*received)
        except DecisionError as error:
            raise ReplayError(f"at t = {frame.time_us * 1e-6:.3f} s: {error}") from error
        known = _known(frame, step, known)
        yield Answer(frame.time_us, command, autopilot, step, known)
        autopilot.serve(inbox.get(frame.time_us, ()))


def _carried(codec: Codec, command: ActuatorCommand) -> ActuatorCommand:
    """Return what arrives of a command: the link rounds it."""
    (message,) = codec.decode(encode_actuators(codec, command))
    arrived = decode_actuators(message)
    assert arrived is not None, "what an autopilot commands can be flown"
    return arrived


def _changed(inputs: Iterable[Input]) -> list[str]:
    """Return the profiles and vehicles of a log that are others under their names by now; none that is gone."""
    changed = []
    for setup in (what for what in inputs if isinstance(what, Setup)):
        with suppress(Error):
            now = load_profile(setup.profile).with_choices(setup.controller, setup.solver, setup.delay_s)
            if setup.profile_tables not in (None, now):
                changed.append(f"profile {setup.profile}")
        with suppress(Error):
            if setup.vehicle_tables not in (None, load_vehicle(setup.vehicle)):
                changed.append(f"vehicle {setup.vehicle}")
    return list(dict.fromkeys(changed))


def _logged_us(tlog: Path) -> int:
    """Return until when the plant has logged the flight of a telemetry log; 0 where its own log is not beside it."""
    try:
        *_, last, _ = (tlog.parent / "plant.csv").read_text(encoding="utf-8").split("\n")
        return round(float(last.partition(",")[0]) * 1e6)
    except (OSError, ValueError):
        return 0


def _begun(setup: Setup) -> Autopilot[Any]:
    """Return an autopilot that begins as it did then."""
    tables = setup.profile_tables or load_profile(setup.profile)
    profile = tables.with_choices(setup.controller, setup.solver, setup.delay_s)
    vehicle = setup.vehicle_tables or load_vehicle(setup.vehicle)
    flown = _track(setup, vehicle, profile)
    if not setup.ground:
        assert flown is not None, "without ground stations a track is flown"
        estimator = estimator_for(setup.feedback, vehicle, setup.origin)
        return track_autopilot(profile, vehicle, flown, _clock, estimator=estimator)
    settings = StationSettings(
        system_id=setup.system_id, identity=setup.identity, origin=setup.origin, feedback=setup.feedback
    )
    history = of_bytes(History, setup.history) if setup.history else None
    return copter_autopilot(profile, vehicle, settings, _clock, values=setup.values, first=flown, history=history)


def _track(setup: Setup, vehicle: Vehicle, profile: Profile) -> Track | None:
    """Return the track that was flown, through the points that its file had then."""
    if setup.track is None:
        return None
    if setup.track_file is None:
        return load_track(setup.track, vehicle, profile, setup.floor_m).track
    with TemporaryDirectory() as folder:
        path = Path(folder) / "waypoints.csv"
        path.write_text(setup.track_file, encoding="utf-8")
        return load_track(with_file(setup.track, path), vehicle, profile, setup.floor_m).track


def _end(setup: Setup, autopilot: Autopilot[Any]) -> AutopilotEnd:
    return AutopilotEnd(
        system_id=setup.system_id,
        frame_interval_us=autopilot.frame_interval_us,
        now_s=_NO_CLOCK_S,
        feedback=setup.feedback,
    )


def _clock() -> float:
    return _NO_CLOCK_S


def _inputs(path: Path, tlog: Path) -> list[Input]:
    try:
        return read(path.read_bytes())
    except FileNotFoundError as error:
        raise ReplayError(
            f"{path} is missing: replay needs it beside {tlog.name}, as `colibri fly` leaves it"
        ) from error
    except OSError as error:
        raise ReplayError(f"cannot read {path}: {error.strerror}") from error
    except InputsError as error:
        raise ReplayError(f"{path}: {error}") from error


def _bytes(tlog: Path) -> bytes:
    try:
        return tlog.read_bytes()
    except OSError as error:
        raise ReplayError(f"cannot read {tlog}: {error.strerror}") from error


def _known(frame: Frame, step: Step, before: StateFrame | None) -> StateFrame | None:
    if isinstance(frame, StateFrame):
        return frame
    return before if step.estimate is None else step.estimate.frame


def _rotors(command: ActuatorCommand) -> str:
    speeds = " ".join(f"{control!r}" for control in command.controls)
    return f"rotors {speeds} of the largest speed, {'armed' if command.armed else 'disarmed'}"


def _state(known: StateFrame | None) -> str:
    if known is None:
        return "not known yet"
    east, north, up = known.position_enu_m
    speed = sum(axis * axis for axis in known.velocity_enu_m_s) ** 0.5
    roll, pitch, yaw = map(degrees, euler_from_quaternion(known.attitude))
    place = f"east {east:.3f} north {north:.3f} up {up:.3f} m, {speed:.2f} m/s"
    return f"{place}, roll {roll:.1f}° pitch {pitch:.1f}° yaw {yaw:.1f}°"
