"""The plant as a simulator of PX4: in lockstep, or, while PX4 starts, at the pace of the wall clock."""

from math import hypot
from time import perf_counter, sleep
from typing import Any

from colibri.common.earth.geodesy import Geodetic, geodetic_of
from colibri.common.errors import Error
from colibri.common.process.lifecycle import Stop, fail
from colibri.common.process.status import Progress, Status
from colibri.common.rotations import earth_from_body
from colibri.mavlink.hil.px4_simulator import SimulatorEnd, Truth
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.links.link import GroundLink, receive_soon
from colibri.mavlink.links.startup import awaiting
from colibri.plant.physics.start import Start, nudged
from colibri.plant.physics.world import Physics, World, starting_world, state_frame
from colibri.plant.process.reports import (
    MAX_WAIT_S,
    SILENT_AFTER_S,
    PlantLogs,
    Silence,
    all_parameters_by,
    closing,
    report_end,
)
from colibri.plant.process.server import FramePacer
from colibri.plant.sensors.suite import SensorSuite
from colibri.plant.spec import PlantSpec
from colibri.plant.vehicle.description import VehicleError, load_vehicle
from colibri.plant.vehicle.parameter_files import px4_gps_delay_ms


def run(spec: PlantSpec, link: GroundLink, status: Status, stop: Stop) -> int:
    try:
        simulator = Simulator(spec, link, status, stop)
    except Error as error:
        fail(str(error))
    with closing(link, simulator.logs):
        simulator.serve()
    return stop.code


class Simulator:
    """Serves one PX4 after another, each from the start."""

    def __init__(self, spec: PlantSpec, link: GroundLink, status: Status, stop: Stop) -> None:
        weather = spec.weather
        vehicle = load_vehicle(spec.vehicle).without(spec.without)
        if vehicle.sensors is None:
            raise VehicleError(f"{vehicle.name} has no sensors: choose one with a table sensors")
        delay_ms = px4_gps_delay_ms(vehicle)
        text = f"{vehicle.name}'s GPS is {delay_ms} ms late, SENS_GPS0_DELAY {delay_ms}"
        status.say("sensors", f"{text}; {all_parameters_by(str(spec.vehicle), 'px4')}", gps_delay_ms=delay_ms)
        self._sensors = vehicle.sensors
        self._rotors, self._order = vehicle.rotors, vehicle.rotors.px4_numbering()
        self._gravity_m_s2 = vehicle.gravity_m_s2
        self._start = starting_world(nudged(spec.started(Start(psi=spec.home.yaw_enu_deg))), vehicle, weather)
        self._physics = Physics(vehicle, spec.integrator, weather, spec.disturbance)
        self._origin: Geodetic = spec.home.origin
        self._interval_us = round(1e3 / spec.rate) * 1000
        self._seed, self._speed, self._duration_us = spec.seed, spec.pace, spec.duration * 1e6
        self._link, self._status, self._stop = link, status, stop
        self._end = SimulatorEnd(system_id=spec.system_id, rotors=vehicle.rotors.count)
        self.logs = PlantLogs(spec.out, vehicle, spec.boot_unix_us, tlog=spec.tlog) if spec.out else None
        self._logged_calls = 1
        self._time_us = 0

    def serve(self) -> None:
        over = False
        while not self._stop and not over:
            if self._link.target is not None:
                self._end.call(self._link.target, perf_counter())
            self._exchange(MAX_WAIT_S)
            self._log_received()
            if self._end.peer is not None:
                self._status.say("connected", "PX4 has called")
                over = self._fly()

    def _fly(self) -> bool:
        began_s, call = perf_counter(), self._end.calls
        suite = SensorSuite(self._sensors, self._physics, self._origin, seed=self._seed, interval_us=self._interval_us)
        world = self._start._replace(time_us=self._interval_us)  # PX4's clock has no use for 0
        pace, progress, frames = FramePacer(self._speed, began_s), Progress(self._status), 0
        silence = Silence(self._status, SILENT_AFTER_S, "PX4 answers again", began_s)
        while not self._stop and self._end.peer is not None and self._end.calls == call:
            if world.time_us > self._duration_us:
                break
            self._wait_until(self._due_s(pace, world))
            self._offer(world, suite)
            progress.report(world.time_us / 1e6, perf_counter() - began_s)
            if self._end.lockstep and not self._await_answer(world, silence):
                break
            world = self._physics.step(world, self._command(world), self._interval_us)
            frames += 1
        gone = self._end.peer is None or self._end.calls != call
        figures: dict[str, Any] = {"frames": frames, "resent": self._end.resent, "dropped": dict(self._end.dropped)}
        event, text = ("gone", "PX4 has gone") if gone else ("ended", "ended")
        text = f"{text} {{}} after {frames} frames"
        if gone:
            text += f"; {awaiting('PX4', self._link)}"
        self._log_received()
        if self.logs:
            self.logs.flush()
        report_end(self._status, world.time_us, began_s, text, event=event, **figures)
        return not gone

    def _due_s(self, pace: FramePacer, world: World) -> float:
        now_s = perf_counter()
        due_s = pace.due_s(world.time_us - self._interval_us, now_s)
        return due_s if self._end.lockstep else max(due_s, now_s + self._interval_us * 1e-6)

    def _offer(self, world: World, suite: SensorSuite) -> None:
        truth = self._truth(world) if self._end.wants_truth(world.time_us) else None
        self._end.offer(suite.measure(world), truth, perf_counter())
        sent = self._send()
        self._log_received()
        self._time_us = world.time_us
        self._log_sent(sent)
        if self.logs:
            self.logs.write_world(world)

    def _truth(self, world: World) -> Truth:
        state = state_frame(world)
        east, north, up = earth_from_body(state.attitude, self._physics.specific_force(world))
        moving = (own - air for own, air in zip(state.velocity_enu_m_s, world.wind_enu_m_s, strict=True))
        airspeed_m_s = hypot(*moving)
        acceleration = (east, north, up - self._gravity_m_s2)
        return Truth(state, geodetic_of(state.position_enu_m, self._origin), acceleration, airspeed_m_s)

    def _await_answer(self, world: World, silence: Silence) -> bool:
        end, call = self._end, self._end.calls
        silence.end(perf_counter())
        while not end.answered and not self._stop:
            self._exchange(MAX_WAIT_S)
            if end.peer is None or end.calls != call:
                return False
            if not end.answered:
                now_s = perf_counter()
                end.poll(now_s)
                silence.lasts(now_s, "no answer", world.time_us, ", waiting for PX4")
        return end.answered

    def _command(self, world: World) -> ActuatorCommand:
        controls, armed = self._end.motors
        return ActuatorCommand(world.time_us, self._rotors.speeds_of(self._order.to_vehicle(controls)), armed)

    def _exchange(self, timeout_s: float) -> None:
        self._log_sent(self._send())
        for datagram, sender in receive_soon(self._link, timeout_s):
            self._end.receive(datagram, sender)
        self._link.take_opened()
        for note in self._link.take_notes():
            self._status.say("said", note)
        for address in self._link.take_closed():
            self._end.close(address)

    def _send(self) -> list[tuple[bytes, ...]]:
        outbox = self._end.take_outbox()
        for frames, address in outbox:
            self._link.send(b"".join(frames), address)
        return [frames for frames, _ in outbox]

    def _log_sent(self, sent: list[tuple[bytes, ...]]) -> None:
        if self.logs and sent:
            self._log_received()
            for frames in sent:
                self.logs.write_frames(self._time_us, list(frames))

    def _log_received(self) -> None:
        if self.logs and self._end.calls > self._logged_calls:
            self.logs.begin_again()
            self._logged_calls, self._time_us = self._end.calls, 0
        if self.logs:
            self.logs.write_frames(self._time_us, self._end.received)
        self._end.received.clear()

    def _wait_until(self, due_s: float) -> None:
        while not self._stop and (early_s := due_s - perf_counter()) > 0.0:
            if self._end.lockstep:
                sleep(min(early_s, MAX_WAIT_S))
            else:
                self._exchange(min(early_s, MAX_WAIT_S))
