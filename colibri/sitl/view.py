"""The observable state of a vehicle."""

from collections.abc import Sequence
from math import dist, hypot
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.commander.rules.modes import Mode, mode_of_custom
from colibri.common.rotations import euler_from_quaternion, tilt_deg
from colibri.common.types import Vector
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.wire.ned import ned_from_enu
from colibri.sitl.backends.lockstep_session import LockstepSession
from colibri.sitl.backends.setting import Setting
from colibri.sitl.flight_record import Columns, Record, StatusTexts
from colibri.sitl.ground_station import Station

__tracebackhide__ = True  # a failed test shows its own lines, not these

_NEAR_M = {"state": 0.3, "sensors": 2.0}
_SLOW_M_S = 0.3


class View:
    """The observable state of a vehicle in flight. Positions and velocities are true, ENU, m and m/s."""

    setting: Setting
    gcs: Station
    record: Record
    _lockstep: LockstepSession
    _texts: StatusTexts

    @property
    def time_us(self) -> int:
        """Simulated time, µs."""
        return self._lockstep.truth.time_us

    @property
    def near_m(self) -> float:
        """Default tolerance of `is_at`, m; larger with sensors, by the error of GPS."""
        return _NEAR_M[self.setting.feedback]

    @property
    def system(self) -> int:
        """The vehicle's system id."""
        return self.setting.system

    @property
    def position(self) -> Vector:
        """Position, ENU, m."""
        return self._lockstep.truth.position_enu_m

    @property
    def velocity(self) -> Vector:
        """Velocity, ENU, m/s."""
        return self._lockstep.truth.velocity_enu_m_s

    @property
    def speed_m_s(self) -> float:
        """Magnitude of the velocity, m/s."""
        return hypot(*self.velocity)

    @property
    def rates(self) -> Vector:
        """Body rates p, q, r, FLU, rad/s."""
        return self._lockstep.truth.rate_flu_rad_s

    @property
    def euler(self) -> Vector:
        """Roll, pitch, yaw, FLU to ENU, rad."""
        return euler_from_quaternion(self._lockstep.truth.attitude)

    @property
    def tilt_deg(self) -> float:
        """Angle between thrust and vertical, degrees."""
        return tilt_deg(self._lockstep.truth.attitude)

    @property
    def mode(self) -> Mode | None:
        """The autopilot's flight mode at this frame, independent of links."""
        return mode_of_custom(self._lockstep.flown.to_stations.custom_mode)

    @property
    def armed(self) -> bool:
        """Whether the autopilot is armed at this frame, independent of links."""
        return self._lockstep.flown.to_stations.armed

    @property
    def rotors(self) -> ActuatorCommand:
        """The autopilot's command at this frame."""
        return self._lockstep.flown.command

    @property
    def home(self) -> Vector | None:
        """Home by the last HOME_POSITION, ENU, m; `None` before the first."""
        if not self.gcs.heard["HOME_POSITION"]:
            return None
        home = self.gcs.latest("HOME_POSITION")
        return ned_from_enu((home.x, home.y, home.z))

    @property
    def texts(self) -> list[str]:
        """All STATUSTEXT sent to the first ground station, independent of links."""
        return self._texts.texts

    @property
    def timed_texts(self) -> list[tuple[float, str]]:
        """Each of `texts` with its time of sending, s."""
        return [(time_us * 1e-6, text) for time_us, text in zip(self._texts.times_us, self.texts, strict=True)]

    def said(self, part: str) -> bool:
        """Whether a STATUSTEXT containing `part` was sent; received ones are in `gcs.texts`."""
        return self._texts.said(part)

    def heard(self, name: str) -> list[Any]:
        """Return the messages of a name that the first ground station has received."""
        return self.gcs.heard[name]

    def is_at(self, place: Sequence[float], near_m: float | None = None, slow_m_s: float = _SLOW_M_S) -> bool:
        """Whether it is near a place, ENU, and slow; near is 0.3 m, with sensors 2 m."""
        near_m = self.near_m if near_m is None else near_m
        return dist(place, self.position) < near_m and self.speed_m_s < slow_m_s

    def flown(self, since_s: float = 0.0) -> Columns:
        """Return `record.columns` from a time on."""
        return self.record.columns(since_s)

    @property
    def path(self) -> NDArray[np.float64]:
        """Positions of all frames, ENU, (n, 3)."""
        flown = self.flown()
        return np.stack([flown["x"], flown["y"], flown["z"]], axis=1)

    @property
    def processes(self) -> dict[str, int]:
        """Process ids of "plant" and "autopilot"; empty in memory."""
        return self._lockstep.processes()

    @property
    def sha256(self) -> str:
        """Hash of truth and command of all frames; the same on all links."""
        return self.record.sha256

    def __repr__(self) -> str:
        return f"<vehicle {self.system}: {self}>"

    def __str__(self) -> str:
        east, north, up = self.position
        words = f"t = {self.time_us * 1e-6:.3f} s, {self.mode or 'no mode'}, {'armed' if self.armed else 'disarmed'}"
        where = f"at ({east:.2f}, {north:.2f}, {up:.2f}) m, {self.speed_m_s:.2f} m/s, tilt {self.tilt_deg:.1f} degrees"
        last = f"; last texts: {'; '.join(self.texts[-3:])}" if self.texts else ""
        return f"{words}, {where}{last}"
