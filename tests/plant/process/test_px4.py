"""PX4's simulator interface: the conversation, and a flight through it over TCP and UDP."""

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from math import inf
from pathlib import Path
from time import monotonic

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic, enu_of, geodetic_of
from colibri.mavlink.hil.px4_simulator import GIVEN_UP_AFTER_S, RESEND_AFTER_S, Motors, SimulatorEnd, Truth
from colibri.mavlink.hil.sensors import SensorFrame, Updated
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.links.link import GroundLink, receive_soon
from colibri.mavlink.links.open import open_ground_link
from colibri.mavlink.wire.dialect import Codec, Message, mav
from colibri.mavlink.wire.tlog import decode
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, starting_world, state_frame
from colibri.plant.vehicle.description import load_vehicle
from tests.support.strangers import Airframe, Known, Point, hovering
from tools.harness.processes import GIVE_UP_AFTER_S, Process, running, topic_rows, wait_for

PX4, OTHER = ("127.0.0.1", 4561), ("127.0.0.1", 4562)
STOPPED = Motors((0.0,) * 4, armed=False)
VEHICLE = load_vehicle("jmavsim")
FRAME_US = 4000
STARTING_FRAMES = 5  # how many frames PX4 needs before it moves a motor
ARM_M, TURN_M = 0.11667, 0.05 / 4.0
JMAVSIM = Airframe(
    0.8,
    (0.005, 0.005, 0.009),
    ((ARM_M, ARM_M, TURN_M), (-ARM_M, -ARM_M, TURN_M), (ARM_M, -ARM_M, -TURN_M), (-ARM_M, ARM_M, -TURN_M)),
)
THRUST_N = 4.0


class Px4:
    """A stand-in for PX4: it sets its clock by HIL_SENSOR, and hovers on the truth that it has asked for."""

    def __init__(self, *, lockstep: bool = True, starting_frames: int = STARTING_FRAMES) -> None:
        self._codec = Codec(1, mav.MAV_COMP_ID_AUTOPILOT1)
        self._flags = 1 if lockstep else 0
        self._starting = starting_frames
        self.time_us = 0
        self.sensors = 0
        self.messages: list[Message] = []
        self.fixes: list[Message] = []
        self.known: Known | None = None
        self.armed = False
        self.target_ned_m: Point = (0.0, 0.0, 0.0)
        self.origin: Geodetic = DEFAULT_ORIGIN

    def hello(self) -> list[bytes]:
        interval = self._codec.encode(
            "COMMAND_LONG", 0, 0, mav.MAV_CMD_SET_MESSAGE_INTERVAL, 0, mav.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, 5e3,
            *[0.0] * 5,
        )  # fmt: skip
        return [interval, self._codec.encode("HEARTBEAT", 0, mav.MAV_AUTOPILOT_PX4, 0, 0, 0, 3)]

    def hear(self, datagram: bytes) -> list[bytes]:
        answers = []
        for message in self._codec.decode(datagram):
            fields = message.fields
            self.messages.append(message)
            if message.name == "HIL_GPS":
                self.fixes.append(message)
            elif message.name == "HIL_STATE_QUATERNION":
                place = Geodetic(fields.lat / 1e7, fields.lon / 1e7, fields.alt / 1e3)
                east, north, up = enu_of(place, self.origin)
                velocity = np.array((fields.vx, fields.vy, fields.vz)) / 100.0
                rate = np.array((fields.rollspeed, fields.pitchspeed, fields.yawspeed))
                self.known = Known(np.array((north, east, -up)), velocity, np.array(fields.attitude_quaternion), rate)
            elif message.name == "HIL_SENSOR":
                assert fields.time_usec >= self.time_us, "its clock cannot go back"
                self.sensors += fields.time_usec > self.time_us
                self.time_us = fields.time_usec
                if self.sensors > self._starting:
                    answers.append(self.answer())
        return answers

    def answer(self, control: float = inf) -> bytes:
        """Return what the motors shall do: hover, or the same control for all."""
        controls = [0.0] * 16
        if self.armed and self.known is not None:
            thrusts = hovering(JMAVSIM, self.known, self.target_ned_m).tolist()
            controls[:4] = [min(1.0, thrust / THRUST_N) if control == inf else control for thrust in thrusts]
        mode = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (mav.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0)
        return self._codec.encode("HIL_ACTUATOR_CONTROLS", self.time_us, controls, mode, self._flags)


FLOWN_S = 6.0


def serve(px4: Px4, link: GroundLink, until: Callable[[], bool], what: str) -> None:
    give_up_s = monotonic() + GIVE_UP_AFTER_S
    while not until():
        assert monotonic() < give_up_s, f"waited in vain for {what}"
        for datagram, sender in receive_soon(link, 0.1):
            for answer in px4.hear(datagram):
                link.send(answer, sender)


def frame(time_us: int) -> SensorFrame:
    return SensorFrame(
        time_us, int(Updated.ACCELEROMETER), (0.0, 0.0, 9.81), (0.0,) * 3, (0.2, 0.0, 0.4), 95000.0, 15.0
    )


def connected() -> tuple[SimulatorEnd, Px4]:
    end, px4 = SimulatorEnd(system_id=1), Px4(starting_frames=0)
    for datagram in reversed(px4.hello()):
        end.receive(datagram, PX4)
    return end, px4


def carried(end: SimulatorEnd, px4: Px4) -> list[bytes]:
    return [answer for frames, _ in end.take_outbox() for answer in px4.hear(b"".join(frames))]


CONTROLS = st.lists(st.floats(width=32), min_size=16, max_size=16)


@given(st.lists(st.tuples(st.integers(0, 3), CONTROLS, st.sampled_from([1, 129]), st.integers(0, 1)), max_size=6))
def test_answers_are_obeyed_alike_alone_and_among_others(answers: list[tuple[int, list[float], int, int]]) -> None:
    """What comes alone is read quickly, what comes with a HEARTBEAT as all messages are."""
    alone, among = connected()[0], connected()[0]
    for answer in answers:
        codec = Codec(1, 1)
        datagram = codec.encode("HIL_ACTUATOR_CONTROLS", *answer)
        alone.receive(datagram, PX4)
        among.receive(datagram + codec.encode("HEARTBEAT", 0, 12, 0, 0, 0, 3), PX4)
        assert alone.received[-1] == among.received[-2] == datagram
        assert (alone.motors, alone.lockstep, alone.answered) == (among.motors, among.lockstep, among.answered)
    assert alone.dropped == among.dropped


def test_it_begins_with_the_first_call() -> None:
    for hello in (Px4().hello(), Px4().hello()[::-1]):  # two threads of PX4 say these
        end = SimulatorEnd(system_id=1)
        end.receive(Px4().answer(), PX4)
        assert (end.peer, end.dropped) == (None, {"not begun": 1})
        end.offer(frame(4000), None, 0.0)
        assert end.take_outbox() == []
        for datagram in hello:
            end.receive(datagram, PX4)
        assert (end.peer, end.calls, end.lockstep) == (PX4, 1, False)
        assert end.wants_truth(0)


def test_an_answer_moves_the_motors_and_begins_the_lockstep() -> None:
    end, px4 = connected()
    end.offer(frame(4000), None, 0.0)
    assert not end.answered
    (answer,) = carried(end, px4)
    end.receive(answer, PX4)
    assert (end.answered, end.lockstep, end.motors) == (True, True, STOPPED)
    assert px4.time_us == 4000


def test_an_autopilot_that_keeps_its_own_time_is_not_waited_for() -> None:
    end = SimulatorEnd(system_id=1)
    px4 = Px4(lockstep=False, starting_frames=0)
    end.receive(px4.hello()[1], PX4)
    end.offer(frame(4000), None, 0.0)
    end.receive(carried(end, px4)[0], PX4)
    assert (end.answered, end.lockstep) == (True, False)


def test_a_frame_that_was_sent_again_is_answered_once() -> None:
    end, px4 = connected()
    end.offer(frame(4000), None, 0.0)
    first = carried(end, px4)
    end.poll(0.5 * RESEND_AFTER_S)
    assert end.resent == 0
    end.poll(RESEND_AFTER_S)
    assert end.resent == 1
    again = carried(end, px4)
    end.receive(first[0], PX4)
    end.offer(frame(8000), None, 2.0)
    end.receive(again[0], PX4)
    assert not end.answered
    assert end.dropped == {"repeated": 1}
    end.receive(carried(end, px4)[0], PX4)
    assert end.answered


@pytest.mark.parametrize(
    ("controls", "motors"),
    [
        ((0.1, 0.2, 0.3, 0.4), (0.1, 0.2, 0.3, 0.4)),
        ((-0.5, 1.5, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0)),
        ((float("nan"), 0.2, 0.3, 0.4), (0.0, 0.0, 0.0, 0.0)),
        ((float("inf"), 0.2, 0.3, 0.4), (0.0, 0.0, 0.0, 0.0)),
    ],
)
def test_controls_that_no_motor_could_follow(controls: tuple[float, ...], motors: tuple[float, ...]) -> None:
    end, _ = connected()
    end.offer(frame(4000), None, 0.0)
    end.receive(Codec(1, 1).encode("HIL_ACTUATOR_CONTROLS", 4000, [*controls, *[0.0] * 12], 129, 1), PX4)
    assert end.answered
    assert end.motors.controls == pytest.approx(motors)


def test_a_second_autopilot_waits_for_the_first_to_end() -> None:
    end, px4 = connected()
    heartbeat = px4.hello()[1]
    end.receive(heartbeat, OTHER)
    assert (end.peer, end.dropped) == (PX4, {"second autopilot": 1})
    end.close(OTHER)
    assert end.peer == PX4
    end.close(PX4)
    end.receive(heartbeat, OTHER)
    assert (end.peer, end.calls, end.motors) == (OTHER, 2, STOPPED)


def test_a_caller_that_answers_nothing_gives_way_to_another() -> None:
    end, px4 = connected()
    heartbeat = px4.hello()[1]
    for now_s, peer in ((100.0, PX4), (100.0 + 0.9 * GIVEN_UP_AFTER_S, PX4), (100.0 + GIVEN_UP_AFTER_S, OTHER)):
        end.offer(frame(round(now_s * 1e6)), None, now_s)
        end.receive(heartbeat, OTHER)
        assert end.peer == peer
    end.offer(frame(10**9), None, 1000.0)
    end.receive(heartbeat, PX4)
    assert end.peer == OTHER


def test_the_truth_is_told_as_often_as_it_is_wanted() -> None:
    end, px4 = connected()
    physics = Physics(VEHICLE, "rk4")
    world = starting_world(Start(x=100.0, y=-50.0, z=20.0, psi=90.0, vx=3.0, vz=-1.0, r=0.5), VEHICLE)
    told = 0
    for _ in range(10):
        world = physics.step(world, ActuatorCommand(0, (0.0,) * 4, armed=False), FRAME_US)
        state = state_frame(world)
        place = geodetic_of(state.position_enu_m, DEFAULT_ORIGIN)
        wanted = end.wants_truth(world.time_us)
        told += wanted
        end.offer(frame(world.time_us), Truth(state, place, (0.0, 0.0, -9.8), 3.2) if wanted else None, 0.0)
        carried(end, px4)
    assert told == 5  # asked for every 5 ms, at frames of 4 ms
    assert px4.known is not None
    assert px4.known.position_m == pytest.approx([-50.0, 100.1, -20.0], abs=0.2)
    assert px4.known.velocity_m_s == pytest.approx([0.0, 3.0, 1.3], abs=0.1)
    assert px4.known.rate_rad_s == pytest.approx([0.0, 0.0, -0.5], abs=1e-3)
    message = next(message for message in px4.messages if message.name == "HIL_STATE_QUATERNION")
    assert (message.fields.true_airspeed, message.fields.zacc) == (320, 999)


@given(st.lists(st.one_of(st.binary(max_size=80), st.sampled_from(Px4().hello()))))
def test_nothing_that_comes_breaks_it(datagrams: list[bytes]) -> None:
    end = SimulatorEnd(system_id=1)
    for datagram in datagrams:
        end.receive(datagram, PX4)
    assert end.motors == STOPPED


@contextmanager
def plant(folder: Path, url: str, *options: str) -> Iterator[Process]:
    process = Process(
        folder,
        "plant",
        *("--serve", "px4", "--link", url, "--vehicle", "jmavsim", "--tlog", "--out", str(folder / "out")),
        *options,
    )
    with running(process):
        yield process


def flown(px4: Px4, link: GroundLink) -> None:
    serve(px4, link, lambda: px4.sensors > 200, "PX4 to be served")
    assert px4.known is not None
    assert px4.known.position_m == pytest.approx([0.0, 0.0, 0.0], abs=0.02)
    px4.armed, px4.target_ned_m = True, (1.0, 0.5, -1.5)
    serve(px4, link, lambda: px4.time_us > 1e6 * FLOWN_S, "the flight")
    assert px4.known.position_m == pytest.approx(px4.target_ned_m, abs=0.05)


def test_a_px4_and_then_another_hover_over_tcp(tmp_path: Path) -> None:
    with plant(tmp_path, "tcpin:127.0.0.1:0", "--tlog") as process:
        url = process.wait_for("listening")["url"].replace("tcpin", "tcp")
        sensors = process.wait_for("sensors")
        assert sensors["gps_delay_ms"] == 200
        assert "SENS_GPS0_DELAY 200; all parameters: colibri vehicle jmavsim --for px4" in sensors["text"]
        for number in (1, 2):
            px4, link = Px4(), open_ground_link(url)
            wait_for(partial(_connected, link), "a connection")
            for datagram in px4.hello():
                link.send(datagram)
            flown(px4, link)
            link.close()
            wait_for(partial(_has_gone, process, number), "the plant to notice")
            times = [message.fields.time_usec for message in px4.messages if message.name == "HIL_SENSOR"]
            assert set(np.diff(times)) == {FRAME_US}
            assert len(px4.fixes) == pytest.approx(20 * FLOWN_S, abs=10)
        assert process.events("gone")[1]["text"].endswith(f"; waiting for PX4 on {url.replace('tcp', 'tcpin')}")
        process.process.terminate()
        assert process.wait() == 143
    for name in ("flight-1.ulg", "flight.ulg"):  # a flight has a file of its own
        flown_s = topic_rows(tmp_path / "out" / name)["t"]
        assert (flown_s[0], flown_s[-1]) == (0.004, pytest.approx(FLOWN_S, abs=0.1))
        assert set(np.diff(np.round(flown_s * 1e6))) == {FRAME_US}
    for name in ("flight-1.tlog", "flight.tlog"):
        logged = list(decode((tmp_path / "out" / name).read_bytes()))
        assert np.diff([each.time_us for each in logged]).min() >= 0
        names = [message.name for each in logged for message in Codec(1, 1).decode(each.frame)]
        assert {"COMMAND_LONG", "HEARTBEAT"} <= set(names[: names.index("HIL_ACTUATOR_CONTROLS")])
        assert names.count("HIL_SENSOR") == pytest.approx(250 * FLOWN_S, abs=25)
    assert len(list((tmp_path / "out").iterdir())) == 4


def test_a_px4_that_waits_to_be_called_is_called_over_udp(tmp_path: Path) -> None:
    px4 = Px4()
    with closing(open_ground_link("udpin:127.0.0.1:0")) as link:
        url = link.url.replace("udpin", "udpout")
        with plant(tmp_path, url) as process:
            calling = process.wait_for("calling")
            assert (calling["url"], calling["text"]) == (url, f"connecting to PX4 at {url}")
            assert process.events("listening") == []
            called = receive_soon(link, GIVE_UP_AFTER_S)
            for datagram in px4.hello():
                link.send(datagram, called[0][1])
            serve(px4, link, lambda: px4.sensors > 500, "frames")


def _connected(link: GroundLink) -> bool:
    link.receive_now()
    return bool(link.take_opened())


def _has_gone(process: Process, times: int) -> bool:
    return len(process.events("gone")) == times


def test_a_vehicle_without_sensors_is_refused_in_one_line(tmp_path: Path) -> None:
    process = Process(
        tmp_path, "plant", "--serve", "px4", "--link", "tcpin:127.0.0.1:0", "--vehicle", "hummingbird-thesis"
    )
    with running(process):
        assert process.wait() == 2
    assert process.errors().splitlines()[-1].endswith("has no sensors: choose one with a table sensors")
