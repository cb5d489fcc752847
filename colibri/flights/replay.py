"""`colibri replay`: feed recorded frames to the autopilot and compare its commands."""

import argparse
from collections.abc import Iterable, Iterator
from contextlib import suppress
from math import degrees
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.control.registry import DecisionError
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.checkpoint import History
from colibri.autopilot.core.copter import copter_autopilot
from colibri.autopilot.core.step import Received, Step
from colibri.autopilot.core.track_stages import track_autopilot
from colibri.autopilot.estimation.state_source import estimator_for
from colibri.autopilot.ground.stations import StationSettings
from colibri.autopilot.guidance.trajectories.loading import load_track
from colibri.autopilot.process.recorded_inputs import InputsError, RecordedInputs, Setup, read_inputs
from colibri.common.config import UNREADABLE
from colibri.common.errors import Error
from colibri.common.files import read_bytes
from colibri.common.process.lifecycle import EXIT_FAILED, fail, one_line
from colibri.common.rotations import earth_from_body, euler_from_quaternion
from colibri.common.serialization import of_bytes
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame, decode_actuators, encode_actuators, encode_state
from colibri.mavlink.ulog.flight_topics import COMMAND, MORE_COMMAND, ROTORS, TRUTH
from colibri.mavlink.ulog.reader import FILE, FlightFile, LogFormatError
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Codec
from colibri.plant.vehicle.description import load_vehicle

_CUT_OFF_US = 1_000_000  # largest difference of the logs' ends if the processes are killed
_NO_CLOCK_S = 0.0  # the wall clock of a replay; decisions must not depend on it


class Answer(NamedTuple):
    """The autopilot's answer in the replay; `command` is the recorded one, `known` the estimate."""

    time_us: int
    command: ActuatorCommand
    autopilot: Autopilot[Any]
    step: Step
    known: StateFrame | None


class Difference(NamedTuple):
    recorded: ActuatorCommand
    replayed: ActuatorCommand
    mode: str
    known: StateFrame | None

    def __str__(self) -> str:
        where = f"first difference at t = {self.recorded.time_us * 1e-6:.3f} s, in mode {self.mode}"
        commands = f"  recorded: {_rotors(self.recorded)}\n  replayed: {_rotors(self.replayed)}"
        return f"{where}\n{commands}\n  vehicle:  {_state(self.known)}"


class Replayed(NamedTuple):
    """The result of a replay: commands compared, and the time of the last one."""

    commands: int
    last_us: int
    difference: Difference | None


class ReplayError(Error):
    """A recording that cannot be replayed."""


def replay(args: argparse.Namespace) -> int:
    with one_line():
        flight = _read(args.log)
        outcome = _compare(flight)
    log, ended_us = flight.path, _ended_us(flight)
    if outcome.difference is not None:
        print(outcome.difference)  # noqa: T201
        fail(f"{log}: the autopilot does not answer as it did, after {outcome.commands} commands", EXIT_FAILED)
    if not args.quiet:
        print(f"{outcome.commands} commands up to t = {outcome.last_us * 1e-6:.3f} s, all identical")  # noqa: T201
        for name in _changed(flight.inputs.setups.values()):
            print(f"{name} is another by now: replayed as it flew")  # noqa: T201
    if ended_us - outcome.last_us > _CUT_OFF_US:
        cut = f"ends at t = {outcome.last_us * 1e-6:.3f} s, and the flight went on to t = {ended_us * 1e-6:.3f} s"
        fail(f"{log} {cut}: it was cut off", EXIT_FAILED)
    return 0


def replay_flight(path: Path) -> Replayed:
    """Replay a log or folder, with the inputs in the log."""
    return _compare(_read(path))


def answers_of(path: Path) -> Iterator[Answer]:
    return _answers(_read(path))


class _Flight(NamedTuple):
    path: Path
    log: FlightFile
    inputs: RecordedInputs

    @property
    def setup(self) -> Setup:
        return next(iter(self.inputs.setups.values()))


def _read(path: Path) -> _Flight:
    if path.is_dir():
        path /= FILE
    try:
        log = FlightFile(path)
        flight = _Flight(path, log, read_inputs(log.inputs()))
    except OSError as error:
        raise ReplayError(f"cannot read {path}: {error.strerror}") from error
    except LogFormatError as error:
        raise ReplayError(str(error)) from error
    except InputsError as error:
        raise ReplayError(f"{path}: {error}") from error
    if next(_recorded(flight), None) is None:
        raise ReplayError(f"{path}: no frame of {flight.setup.feedback} feedback was answered: nothing to replay")
    return flight


def _recorded(flight: _Flight) -> Iterator[tuple[int, bytes, ActuatorCommand]]:
    setup = flight.setup
    codec = Codec(setup.system_id, dialect.PLANT_COMPONENT)
    truth = _truth_frames(flight.log) if setup.feedback is Feedback.STATE else iter(())
    true: StateFrame | None = None
    rotors = setup.vehicle_tables.rotors.count
    others = (row[1:] for block in flight.log.blocks(MORE_COMMAND) for row in block.tolist())
    for time_s, *controls, armed in (row for block in flight.log.blocks(COMMAND) for row in block.tolist()):
        if rotors > ROTORS:
            controls += next(others, ())
        time_us = round(1e6 * time_s)
        datagram = flight.inputs.frames.get(time_us)
        while datagram is None and (true is None or true.time_us < time_us):
            true = next(truth, None)
            if true is None:
                return
        if datagram is None:
            assert true is not None
            if true.time_us > time_us:
                return
            try:
                datagram = b"".join(encode_state(codec, true))
            except OverflowError as error:
                raise ReplayError(f"{flight.path}: state at t = {time_s:.3f} s: {error}: the log is damaged") from error
        yield time_us, datagram, ActuatorCommand(time_us, tuple(controls[:rotors]), bool(armed))


def _truth_frames(log: FlightFile) -> Iterator[StateFrame]:
    for block in log.blocks(TRUTH):
        for time_s, u, v, w, p, q, r, x, y, z, qw, qx, qy, qz, *_ in block.tolist():
            attitude = (qw, qx, qy, qz)
            velocity = earth_from_body(attitude, (u, v, w))
            yield StateFrame(round(1e6 * time_s), (x, y, z), velocity, attitude, (p, q, r))


def _compare(flight: _Flight) -> Replayed:
    codec = Codec(flight.setup.system_id, dialect.AUTOPILOT_COMPONENT)
    commands = last_us = 0
    try:
        for answer in _answers(flight):
            replayed = _carried(codec, answer.step.command)
            if replayed != answer.command:
                difference = Difference(answer.command, replayed, answer.autopilot.stages.mode, answer.known)
                return Replayed(commands, last_us, difference)
            commands, last_us = commands + 1, answer.time_us
    except ReplayError:
        raise
    except Error as error:
        raise ReplayError(f"{flight.path}: {error}") from error
    return Replayed(commands, last_us, None)


def _answers(flight: _Flight) -> Iterator[Answer]:
    setups, inbox = flight.inputs.setups, flight.inputs.datagrams
    autopilot: Autopilot[Any] | None = None
    known: StateFrame | None = None
    for time_us, datagram, command in _recorded(flight):
        if time_us in setups:
            setup = setups[time_us]
            autopilot = _begun(setup)
            end = AutopilotEnd(
                system_id=setup.system_id,
                frame_interval_us=autopilot.frame_interval_us,
                now_s=_NO_CLOCK_S,
                feedback=setup.feedback,
            )
        received = None if autopilot is None else end.receive(datagram, _NO_CLOCK_S)
        if autopilot is None or received is None:
            continue
        frame = received.frame
        try:
            step = autopilot.step(frame, received.plant_status)
        except DecisionError as error:
            raise ReplayError(f"at t = {frame.time_us * 1e-6:.3f} s: {error}") from error
        if isinstance(frame, StateFrame):
            known = frame
        elif step.estimate is not None:
            known = step.estimate.frame
        yield Answer(frame.time_us, command, autopilot, step, known)
        served = inbox.get(frame.time_us, ())
        autopilot.serve([Received(each.datagram, each.link, each.address, each.loopback) for each in served])


def _carried(codec: Codec, command: ActuatorCommand) -> ActuatorCommand:
    (message,) = codec.decode(encode_actuators(codec, command))
    arrived = decode_actuators(message, len(command.controls))
    assert arrived is not None, "what an autopilot commands can be flown"
    return arrived


def _changed(setups: Iterable[Setup]) -> list[str]:
    changed = []
    for setup in setups:
        with suppress(Error):
            now = load_profile(setup.profile).with_choices(setup.controller, setup.solver, setup.delay_s)
            if setup.profile_tables != now:
                changed.append(f"profile {setup.profile}")
        with suppress(Error):
            if setup.vehicle_tables != load_vehicle(setup.vehicle):
                changed.append(f"vehicle {setup.vehicle}")
    return list(dict.fromkeys(changed))


class _Ended(msgspec.Struct):
    sim_time_s: float


def _ended_us(flight: _Flight) -> int:
    ended_s = max((float(block[-1, 0]) for block in flight.log.blocks(TRUTH)), default=0.0)
    with suppress(OSError, *UNREADABLE):
        content = read_bytes(flight.path.parent / "report.json")
        ended_s = max(ended_s, msgspec.json.decode(content, type=_Ended).sim_time_s)
    return round(1e6 * ended_s)


def _begun(setup: Setup) -> Autopilot[Any]:
    profile = setup.profile_tables.with_choices(setup.controller, setup.solver, setup.delay_s)
    vehicle = setup.vehicle_tables
    flown = None
    if setup.track is not None:
        flown = load_track(setup.track, vehicle, profile, setup.floor_m, setup.track_file).track
    if not setup.ground:
        assert flown is not None, "without ground stations a track is flown"
        estimator = estimator_for(setup.feedback, vehicle, setup.origin)
        return track_autopilot(profile, vehicle, flown, lambda: _NO_CLOCK_S, estimator=estimator)
    settings = StationSettings(
        system_id=setup.system_id, identity=setup.identity, origin=setup.origin, feedback=setup.feedback
    )
    values, history = setup.values, of_bytes(History, setup.history) if setup.history else None
    return copter_autopilot(
        profile, vehicle, settings, lambda: _NO_CLOCK_S, values=values, first=flown, history=history
    )


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
