"""Landing detection: still while the reference sinks."""

from math import degrees, dist, hypot, sqrt
from typing import NamedTuple

from colibri.autopilot.control.interface import VehicleState
from colibri.common.elementary import acos
from colibri.common.records import Record
from colibri.common.types import Vector

_BELOW_M, _FAR_BELOW_M = 0.15, 1.0
_STILL_M_S = 0.15
_LEVEL_RAD_S = 0.5
_FOR_US = 400_000
_DRIFTING_FOR_US = 600_000
CARRIED = 0.5  # thrust relative to weight below which a vehicle of unknown velocity falls or stands
_MODEL_ERROR, _UNCARRIED_S = 0.2, 1.0
"""Of the modelled lift in parts of weight, and the lack of it that proves ground: by then a fall is 10 m/s faster."""
_UNCARRIED_STILL_S, _FALLS_M_S2 = 0.2, 4.0
"""The same where the climb rate falls by less than this per second of weight: in the air by more than 9."""
_JUMP_M_S = 1.0  # change of the climb rate in a sample that no force causes: a corrected estimate, or the ground
SUSPECTED_S = 0.1  # lack of lift from which on a failed sensor may take the ground for a motion
_HELD_M, _HELD_US = 0.3, 5_000_000
_CLEAR_M = 0.3
HARD_M_S, HARD_UP = 3.0, 0.5  # speed, and cosine of the tilt, beyond which a contact is an impact
HARD_WITHIN_US = 4_000_000  # a landing is detected at most so long after its contact
_SUNK_M = 0.5
KNOCK_SAMPLES = 6
_KNOCK_M_S, _KNOCK_M_S2 = 2.0, 50.0  # velocity change within so many samples, and acceleration, of a contact alone
_SCRAPES_M, _SCRAPES_US = 0.1, 500_000  # height and duration of a motion along the ground that is an impact
HELD_DOWN_M, NEAR_GROUND_M = 0.5, 1.0  # missing height after a fall, and largest distance from the last standing place
_JOLTED_S = 0.08  # impulse of a descent that the ground ends, in seconds of weight
_PUSHED = 0.5  # moment of feet, in parts of a quarter of the weight at a rotor; in the air below 0.15

STANDING_BELOW_M = 0.5
STANDING_SLOWER_M_S = 0.3


class Landing(Record, frozen=True):
    """Start of the stillness, and the climb rate then."""

    since_us: int | None = None
    climb_m_s: float = 0.0


_MOVES = Landing()


def watch(
    landing: Landing, now_us: int, state: VehicleState, sinks: bool, *, drifts: bool = False, slides: bool = False
) -> tuple[Landing, bool]:
    """Return the state, and whether the vehicle stands: still for long while it `sinks`.

    If the velocity estimate `drifts`, as without GPS, only its changes count: at half thrust a vehicle in the air would
    accelerate. If wind `slides` it along the ground, only its climb rate counts.
    """
    if not sinks:
        return _MOVES, False
    climb_m_s = state.velocity_enu_m_s[2]
    if drifts:
        still, for_us = abs(climb_m_s - landing.climb_m_s) < _STILL_M_S, _DRIFTING_FOR_US
    elif slides:
        still, for_us = abs(climb_m_s) < _STILL_M_S, _DRIFTING_FOR_US
    else:
        still, for_us = max(map(abs, state.velocity_enu_m_s)) < _STILL_M_S, _FOR_US
    if max(map(abs, state.rate_flu_rad_s)) >= _LEVEL_RAD_S:
        return _MOVES, False
    if landing.since_us is None or not still:
        return (Landing(now_us, climb_m_s) if still or drifts else _MOVES), False
    return landing, now_us - landing.since_us >= for_us


class Lack(NamedTuple):
    """Lack of lift by CUSUM, in seconds of weight, the climb rate before it, and the last climb rate."""

    lack_s: float = 0.0
    climb_m_s: float = 0.0
    last_m_s: float = 0.0

    def after(self, lift: float, climb_m_s: float, interval_s: float) -> "Lack":
        """Add a sample of the rotors' lift, in parts of weight; restart if the estimate jumps."""
        if abs(climb_m_s - self.last_m_s) > _JUMP_M_S:
            return Lack(0.0, climb_m_s, climb_m_s)
        lack_s = max(self.lack_s + (1.0 - _MODEL_ERROR - lift) * interval_s, 0.0)
        return Lack(lack_s, self.climb_m_s if self.lack_s and lack_s else climb_m_s, climb_m_s)

    def is_carried(self, climb_m_s: float) -> bool:
        """Whether the ground carries the vehicle: it lacks lift for long, or less long and neither falls nor climbs."""
        moves = climb_m_s - self.climb_m_s < -_FALLS_M_S2 * self.lack_s or climb_m_s > _JUMP_M_S
        return self.lack_s >= (_UNCARRIED_S if moves else _UNCARRIED_STILL_S)


class Held(Record, frozen=True):
    """Start of a time without change of height though the reference is far below, and the height."""

    since_us: int | None = None
    height_m: float = 0.0

    def after(self, now_us: int, wanted_m: float, state: VehicleState) -> "Held":
        z = state.position_enu_m[2]
        if not is_far_below(wanted_m, state):
            return Held()
        return Held(now_us, z) if self.since_us is None or abs(z - self.height_m) > _HELD_M else self

    def is_long(self, now_us: int) -> bool:
        """Whether only the ground can hold the vehicle, even if it rocks on an edge."""
        return self.since_us is not None and now_us - self.since_us >= _HELD_US


class Scrape(Record, frozen=True):
    """Start of a fast motion along the ground, without a knock, though the vehicle should be well above."""

    since_us: int | None = None

    def after(self, now_us: int, wanted_m: float, state: VehicleState, ground_m: float) -> "Scrape":
        close = abs(state.position_enu_m[2] - ground_m) < _SCRAPES_M and is_held_down(wanted_m, state, ground_m)
        if not close or hypot(*state.velocity_enu_m_s) <= HARD_M_S:
            return Scrape()
        return Scrape(now_us) if self.since_us is None else self

    def is_long(self, now_us: int) -> bool:
        return self.since_us is not None and now_us - self.since_us >= _SCRAPES_US


class Motion(Record, frozen=True):
    time_us: int
    velocity_enu_m_s: Vector


class Hardest(NamedTuple):
    """The last motion too hard to land with."""

    time_us: int = -HARD_WITHIN_US
    speed_m_s: float = 0.0
    up: float = 1.0
    height_m: float = 0.0

    def after(self, now_us: int, state: VehicleState) -> "Hardest":
        vx, vy, vz = state.velocity_enu_m_s
        _, x, y, _ = state.attitude
        squared, up = vx * vx + vy * vy + vz * vz, 1.0 - 2.0 * (x * x + y * y)
        if squared <= HARD_M_S * HARD_M_S and up >= HARD_UP:
            return self
        old = Hardest() if now_us - self.time_us > HARD_WITHIN_US else self
        return Hardest(now_us, max(sqrt(squared), old.speed_m_s), min(up, old.up), state.position_enu_m[2])

    def is_past(self, state: VehicleState) -> bool:
        """Whether the vehicle has sunk well below that motion, and still sinks: it did not end at the ground."""
        return state.position_enu_m[2] < self.height_m - _SUNK_M and state.velocity_enu_m_s[2] < -_STILL_M_S

    def is_recent(self, now_us: int) -> bool:
        return now_us - self.time_us <= HARD_WITHIN_US

    def impact(self, now_us: int) -> str:
        """Return the impact of a contact with the ground as text; empty for a landing."""
        if not self.is_recent(now_us):
            return ""
        tilt_deg = degrees(acos(max(self.up, -1.0)))
        return f"Impact at {self.speed_m_s:.1f} m/s" + (f", tilted {tilt_deg:.0f} degrees" if self.up < HARD_UP else "")


def knock(before: Motion, now: Motion, height_m: float) -> str:
    """Return the impact that the vehicle flies on from, `height_m` above the ground, as text; empty without one."""
    if abs(height_m) > NEAR_GROUND_M:
        return ""
    speed_m_s = hypot(*before.velocity_enu_m_s)
    if speed_m_s <= HARD_M_S:
        return ""
    changed_m_s = dist(before.velocity_enu_m_s, now.velocity_enu_m_s)
    least_m_s = max(_KNOCK_M_S, _KNOCK_M_S2 * 1e-6 * (now.time_us - before.time_us))
    return f"Impact at {speed_m_s:.1f} m/s" if changed_m_s > least_m_s else ""


def is_below(height_m: float, state: VehicleState) -> bool:
    return height_m < state.position_enu_m[2] - _BELOW_M


def is_far_below(height_m: float, state: VehicleState) -> bool:
    """Whether a reference has sunk so far below that only the ground can hold the vehicle."""
    return height_m < state.position_enu_m[2] - _FAR_BELOW_M


def is_held_down(wanted_m: float, state: VehicleState, ground_m: float) -> bool:
    """Whether a vehicle stays at the ground though it should be well above."""
    z = state.position_enu_m[2]
    return z < wanted_m - HELD_DOWN_M and abs(z - ground_m) < NEAR_GROUND_M


def is_touching(push: float, jolt_s: float, state: VehicleState, ground_m: float) -> bool:
    """Whether a moment or a jolt comes from feet on the ground, which must be near: a failed rotor pushes, too."""
    return (push > _PUSHED or jolt_s > _JOLTED_S) and abs(state.position_enu_m[2] - ground_m) < NEAR_GROUND_M


def stands_at_first(state: VehicleState, home_z_m: float) -> bool:
    """Guess from the first state: low and still."""
    still = max(map(abs, state.velocity_enu_m_s)) < STANDING_SLOWER_M_S
    return still and abs(state.position_enu_m[2] - home_z_m) < STANDING_BELOW_M


def is_clear(landing: Landing, state: VehicleState, ground_m: float) -> bool:
    """Whether a vehicle in flight is well above or below its last standing height."""
    return landing.since_us is None and abs(state.position_enu_m[2] - ground_m) > _CLEAR_M
