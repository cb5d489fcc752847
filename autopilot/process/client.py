"""The autopilot's end of the link to a plant."""

from collections.abc import Callable
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeVarTuple

from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.step import Step, answer
from colibri.autopilot.process.logs import AutopilotLog
from colibri.common.process.lifecycle import Stop
from colibri.common.process.log_files import LogError
from colibri.common.process.status import Status
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.px4_autopilot import FlierEnd
from colibri.mavlink.links.link import BlockingReceiver
from colibri.mavlink.links.udp import UdpLink
from colibri.mavlink.wire.dialect import RESULT_UNSUPPORTED

if TYPE_CHECKING:
    from colibri.autopilot.process.ground import GroundService


Ts = TypeVarTuple("Ts")
_SILENCE_REPORTED_AFTER_S = 2.0
_MAX_WAIT_S = 0.1
_UNKNOWN_REPORTED_AFTER_US = 3_000_000  # simulated time; alignment at rest takes 1 s
_UNKNOWN = "no estimate yet: the vehicle must rest for a second, with a GPS fix; until then the rotors stand"


def _refusal(result: int) -> str:
    if result == RESULT_UNSUPPORTED:
        return "the plant's vehicle has no sensors"
    return "the plant flies at another frame rate or feedback, and will not change it in mid-flight"


class PlantClient:
    def __init__(
        self,
        link: UdpLink | BlockingReceiver,
        end: AutopilotEnd | FlierEnd,
        status: Status,
        stop: Stop,
        log: AutopilotLog | None,
        ground: "GroundService | None" = None,
    ) -> None:
        self._link = link
        self._end = end
        self._status = status
        self._stop = stop
        self._log = log
        self._ground = ground
        self._frame_came = self._flying = False
        self._refusal_reported = self._unknown_reported = False
        self._unknown_since_us: int | None = None

    def fly(self, autopilot: Autopilot[Any]) -> None:
        """Answer frames until stopped, or raise DecisionError or LogError."""
        self._status.say("calling", "waiting for the plant at " + self._link.url.partition(":")[2])
        due_s = 0.0
        while not self._stop:
            received = self._link.receive(min(max(0.0, due_s - perf_counter()), _MAX_WAIT_S))
            step, ahead_us = self._answered(autopilot, received[0]) if received else (None, range(0))
            self._send()
            due_s = self._end.poll(perf_counter())
            self._send()
            if step:  # while the plant integrates
                if ahead_us:
                    autopilot.go_on(ahead_us[-1])
                if self._ground is None:
                    autopilot.serve()
                self._frame_came = True
                self._report_if_unknown(step)
                datagram = received[0] if received and isinstance(self._end, AutopilotEnd) else None
                self._keep(AutopilotLog.write, step, datagram, ahead_us)
            if step and self._ground:
                autopilot = self._ground.serve(perf_counter())
                if self._ground.shut_down:
                    break
            self._report_changes()
            for note in self._link.take_notes():
                self._status.say("said", note)
        self._keep(AutopilotLog.flush)
        self._status.say("ended", "ended", repeated=self._end.repeated, dropped=dict(self._end.dropped))

    def _answered(self, autopilot: Autopilot[Any], datagram: bytes) -> tuple[Step | None, range]:
        """Answer a datagram, and without ground stations the frames up to the next control sample.

        Return the times of those that will not come.
        """
        now_s, end, interval_us = perf_counter(), self._end, autopilot.frame_interval_us
        if self._ground is not None or not isinstance(end, AutopilotEnd):
            return answer(end, autopilot.step, datagram, now_s), range(0)
        received = end.receive(datagram, now_s)
        if received is None:
            return None, range(0)
        step = autopilot.step(received.frame, received.plant_status)
        now_us, frames = step.command.time_us, 1
        if step.decision is not None:
            while end.may_answer_ahead(time_us := now_us + frames * interval_us) and not autopilot.is_due(time_us):
                frames += 1
        end.answer(step.command._replace(frames=frames) if frames > 1 else step.command, step.faults)
        next_us = min(autopilot.next_us(now_us), now_us + frames * interval_us)
        return step, range(now_us + interval_us, next_us, interval_us)

    def _keep(self, write: Callable[[AutopilotLog, *Ts], None], *args: *Ts) -> None:
        """Write to the log, whose failure ends only flights without ground stations."""
        if self._log is None:
            return
        try:
            write(self._log, *args)
        except LogError as error:
            if self._ground is None:
                raise
            self._status.say("said", f"{error}; flying on")

    def _send(self) -> None:
        for datagram in self._end.take_outbox():
            self._link.send(datagram)

    def _report_if_unknown(self, step: Step) -> None:
        now_us = step.command.time_us
        if step.known:
            self._unknown_since_us = None
        elif self._unknown_since_us is None or now_us < self._unknown_since_us:
            self._unknown_since_us, self._unknown_reported = now_us, False
        elif now_us - self._unknown_since_us >= _UNKNOWN_REPORTED_AFTER_US and not self._unknown_reported:
            self._unknown_reported = True
            self._status.say("unknown", _UNKNOWN)

    def _report_changes(self) -> None:
        silent = self._end.silence_s(perf_counter()) > _SILENCE_REPORTED_AFTER_S
        if not self._flying and self._frame_came and not silent:
            self._flying = True
            self._status.say("flying", "the plant sends frames")
        elif self._flying and silent:
            self._frame_came = self._flying = False
            self._status.say("silence", f"no frame for {_SILENCE_REPORTED_AFTER_S:.0f} s, waiting for a plant")
        if self._end.refused is not None and not self._refusal_reported:
            self._refusal_reported = True
            self._status.say("refused", _refusal(self._end.refused))
