"""The start of a flight: on the ground, in mid-flight, after missed frames, or after a restart of the autopilot."""

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.core.checkpoint import Checkpointer, History
from colibri.autopilot.core.parts import Parts
from colibri.autopilot.core.supervision import Supervision
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.services.statustext import WARNING

FALLS = "Restarted in flight without a record: falling"


class FlightStart:
    """Starts the flights of one vehicle, from `history` after a restart; at time 0 rotors turn at `start_speed`."""

    def __init__(
        self,
        parts: Parts,
        supervision: Supervision,
        recorder: Checkpointer,
        history: History | None,
        start_speed: float,
    ) -> None:
        self._parts, self._supervision, self._checkpointer = parts, supervision, recorder
        self._history = history
        self.wakes = history is not None  # whether to resume the estimator before the next frame
        self._start_speed = start_speed
        self.resumed = ""  # text on the continued flight after a restart

    def wake(self, time_us: int) -> None:
        self.wakes = False
        if self._history is not None and self._history.checkpoint.state_source:
            self._parts.state_source.resume(self._history.checkpoint.state_source, time_us)

    def begin(self, frame: StateFrame, before_us: int | None) -> None:
        """Start at a frame that does not follow the last one, of `before_us`."""
        self._supervision.miss(before_us)
        history, self._history = self._history, None
        if history is not None and history.checkpoint.is_followed_by(frame.time_us):
            self._resume(history, frame)
        elif before_us is not None and frame.time_us > before_us:
            loop = self._parts.loop
            loop.begin_in_flight(loop.observe(frame).euler[2])
            self._parts.rotor_loss.begin(loop.controls)
        else:
            self._begin(frame, again=before_us is not None)

    def _resume(self, history: History, frame: StateFrame) -> None:
        parts, pilot, checkpoint = self._parts, self._parts.pilot, history.checkpoint
        if checkpoint.pilot.state.mode is not Mode.TRACK or checkpoint.task.began_us != 0:
            parts.tasks.first = None
        self._supervision.listen(frame.time_us)
        self._checkpointer.resume(history, frame, parts.tasks.again)
        turns, stopped = pilot.state.armed and not pilot.ground.idles, parts.loop.vehicle.rotors.stopped
        parts.actuation.begin(parts.loop.controls if turns else stopped)
        parts.stations.introduce()
        if not pilot.state.armed:
            return
        self._catch(frame.time_us)
        mode, seq = pilot.state.mode, parts.stations.missions.executor.progress.seq
        what = f"mission continues at item {seq}" if mode is Mode.MISSION else f"{mode} continues"
        self.resumed = f"Restarted in flight: {what}"
        parts.lines.say(WARNING, self.resumed)

    def _begin(self, frame: StateFrame, *, again: bool) -> None:
        parts, loop, rests = self._parts, self._parts.loop, self._parts.state_source.rests
        if again:
            parts.stations.system.reboot()
        speed = self._start_speed if frame.time_us == 0 else loop.vehicle.hover_speed
        loop.begin(loop.vehicle.rotors.idle_speed if rests else speed, parts.tasks.first_yaw_rad)
        mode = None if parts.tasks.first is None else Mode.TRACK
        delay_us = parts.delay.delay_us
        parts.pilot.begin(frame.time_us, loop.observe(frame), mode=mode, rests=rests, delay_us=delay_us)
        parts.rotor_loss.forget()
        parts.actuation.begin(loop.vehicle.rotors.stopped if parts.pilot.ground.standing else loop.controls)
        parts.pilot.readiness.rotor_failed = ""
        self._catch(frame.time_us)
        parts.stations.introduce()

    def _catch(self, now_us: int) -> None:
        if self._parts.state_source.estimate is not None and not self._parts.state_source.rests:
            self._parts.lines.say(WARNING, FALLS)
            self._supervision.catch(now_us)
