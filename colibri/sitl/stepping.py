"""Methods of all flights in simulated time."""

from collections.abc import Callable
from typing import Any, Protocol

from colibri.common.types import Vector
from colibri.mavlink.client.conversation import Encoded
from colibri.mavlink.client.setpoints import manual_control, position_target
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT
from colibri.sitl.errors import SitlError

__tracebackhide__ = True  # a failed test shows its own lines, not these


class NotInTimeError(SitlError, AssertionError):
    """A condition was not met in time."""


class Stepped(Protocol):
    """A flight whose simulated time passes only in `step`."""

    __slots__ = ()

    @property
    def time_us(self) -> int:
        """Simulated time, µs."""

    def step(self) -> None:
        """Fly one frame."""

    @property
    def time_s(self) -> float:
        """Simulated time, s."""
        return self.time_us * 1e-6

    def run(self, seconds: float, each_frame: Callable[[], object] | None = None) -> None:
        """Fly for `seconds` of simulated time; call `each_frame` before each frame."""
        if not seconds >= 0.0:
            raise ValueError(f"seconds to fly must be from 0 on, not {seconds!r}")
        end_us = self.time_us + round(seconds * 1e6)
        while self.time_us < end_us:
            if each_frame is not None:
                each_frame()
            self.step()

    def wait_until(self, predicate: Callable[[], object], *, within: float, what: str = "") -> float:
        """Fly until `predicate()` and return the time it took, s; NotInTimeError after `within` s."""
        began_us = self.time_us
        end_us = began_us + round(within * 1e6)
        while not predicate():
            if self.time_us >= end_us:
                raise NotInTimeError(f"{what or 'the condition'} took longer than {within:g} s: {self}")
            self.step()
        return (self.time_us - began_us) * 1e-6

    def hold(self, predicate: Callable[[], object], *, for_: float, what: str = "") -> None:
        """Fly for `for_` seconds; NotInTimeError if `predicate()` fails at any frame."""
        began_us = self.time_us
        end_us = began_us + round(for_ * 1e6)
        while True:
            if not predicate():
                after_s = (self.time_us - began_us) * 1e-6
                raise NotInTimeError(f"{what or 'the condition'} did so for {after_s:.3f} of {for_:g} s: {self}")
            if self.time_us >= end_us:
                return
            self.step()


class Steered(Protocol):
    """A vehicle that takes sticks and setpoints, which are not acknowledged."""

    @property
    def system(self) -> int: ...

    def send(self, name: str, *fields: Any) -> None:
        """Send a message from the first ground station."""

    def stick(self, pitch: float = 0.0, roll: float = 0.0, thrust: float = 0.5, yaw: float = 0.0) -> None:
        """Send sticks once: forward, right, up (0..1, neutral 0.5), clockwise; each -1..1."""
        self._send(manual_control(self.system, pitch, roll, thrust, yaw))

    def setpoint(
        self,
        position: Vector | None = None,
        velocity: Vector | None = None,
        acceleration: Vector | None = None,
        yaw: float | None = None,
        yaw_rate: float | None = None,
    ) -> None:
        """Send an offboard setpoint once, ENU, SI; omitted quantities are masked."""
        target = (self.system, AUTOPILOT_COMPONENT)
        self._send(position_target(target, position, velocity, acceleration, yaw, yaw_rate))

    def _send(self, encoded: Encoded) -> None:
        name, fields = encoded
        self.send(name, *fields)
