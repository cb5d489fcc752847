"""Simulated calibrations with PX4's "[cal] ..." texts, which ground stations parse."""

from colibri.mavlink.services.command import TEMPORARILY_REJECTED, UNSUPPORTED, ReceivedCommand
from colibri.mavlink.wire.refusal import Refusal

_STEP_US = 100_000
_STEPS = 10


class Calibration:
    def __init__(self) -> None:
        self._kind = ""
        self._step = 0
        self._due_us = 0

    def begin(self, command: ReceivedCommand, *, armed: bool) -> Refusal | None:
        if armed:
            return Refusal("calibration refused: the rotors are armed")
        chosen = (command.p1, command.p2, command.p3, command.p4, command.x, command.y, command.z)
        kind = _kind_of(chosen)
        if kind is None:
            return Refusal("calibration refused: only gyro, mag, accel and level are known", UNSUPPORTED)
        if kind and self._kind:
            return Refusal("calibration refused: another one is under way", TEMPORARILY_REJECTED)
        if not kind:
            cancelled, self._kind = self._kind, ""
            self._step = -1 if cancelled else 0
        else:
            self._kind, self._step, self._due_us = kind, 0, command.now_us
        return None

    def poll(self, now_us: int) -> list[str]:
        if self._step == -1:
            self._step = 0
            return ["[cal] calibration cancelled"]
        if not self._kind or now_us < self._due_us:
            return []
        self._due_us = now_us + _STEP_US
        step, self._step = self._step, self._step + 1
        if step == 0:
            return [f"[cal] calibration started: 2 {self._kind}"]
        if step <= _STEPS:
            return [f"[cal] progress <{100 * step // _STEPS}>"]
        kind, self._kind, self._step = self._kind, "", 0
        return [f"[cal] calibration done: {kind}"]


def _kind_of(p: tuple[float, ...]) -> str | None:
    given = [0.0 if value != value else value for value in p]  # nan: not given
    chosen = [(place, value) for place, value in enumerate(given) if value != 0.0]
    if not chosen:
        return ""
    known = {(0, 1.0): "gyro", (1, 1.0): "mag", (4, 1.0): "accel", (4, 2.0): "level"}
    return known.get(chosen[0]) if len(chosen) == 1 else None
