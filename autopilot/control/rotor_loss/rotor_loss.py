"""The loss of a rotor: detection, and landing on three where four were, with any control law.

Where more than four were, the control law flies on with those that remain, rebuilt without the lost one.
"""

from collections.abc import Callable
from functools import lru_cache
from math import isfinite
from typing import Protocol, TypeAlias

from colibri.autopilot.control.interface import AT_REST, Decision, VehicleState
from colibri.autopilot.control.rotor_loss.detector import RotorWatch
from colibri.autopilot.control.rotor_loss.reduced_attitude import ReducedAttitude, ThreeRotorsError
from colibri.autopilot.control.rotor_loss.three_rotors import ThreeRotors, law_without
from colibri.autopilot.control.vehicle_model.mixer import holds_yaw
from colibri.common.types import Array, PerRotor
from colibri.plant.vehicle.description import Vehicle

_FOUR = 4
MAX_INTERVAL_S = 0.02  # longest control interval for the landing: half a radian at four turns a second
_CLEAR_M, _CLEAR_INVERTED_M = 0.3, 5.0  # height for detection: ground presses an inverted vehicle as a loss does

Laws: TypeAlias = tuple[ReducedAttitude, ...]  # one law for the loss of each rotor, (4,); none for more rotors


@lru_cache(maxsize=4)
def laws_of(vehicle: Vehicle, interval_s: float) -> Laws:
    if vehicle.rotors.count < _FOUR:
        raise ThreeRotorsError("the vehicle has three rotors")
    return tuple(law_without(vehicle, lost, interval_s) for lost in range(_FOUR if _lands(vehicle) else 0))


def _lands(vehicle: Vehicle) -> bool:
    return vehicle.rotors.count <= _FOUR


class Permission(Protocol):
    """What to do after the loss of a rotor."""

    @property
    def rotor_failure(self) -> int: ...


class RotorLoss:
    """Watches the rotors of one vehicle, and lands it after the loss of one of four.

    Attributes:
        rebuild: Called with the lost rotor for the law to fly without it, or None: with all of them.
    """

    def __init__(self, vehicle: Vehicle, interval_us: int) -> None:
        self._interval_s = interval_us * 1e-6
        self._adopt_laws(vehicle)
        self._designing, self._designed = vehicle, _FOUR
        self.watch = RotorWatch(vehicle, self._interval_s)
        self._three: ThreeRotors | None = None
        self.enabled, self._lands_always = True, False
        self.rebuild: Callable[[int | None], None] = lambda _lost: None

    @property
    def lost(self) -> int | None:
        return self.watch.lost

    @property
    def landing_for(self) -> int | None:
        """The lost rotor if the vehicle must land for it."""
        return self.watch.lost if self._lands_always or _lands(self._vehicle) else None

    @property
    def remaining(self) -> str:
        """Names the rotors that fly after a loss, and whether they can set the yaw."""
        if _lands(self._vehicle):
            return "three rotors"
        return f"{self._vehicle.rotors.count - 1} rotors{'' if holds_yaw(self._vehicle) else ', yaw given up'}"

    @property
    def flies(self) -> bool:
        return self._three is not None and not self._three.landed

    @property
    def landed(self) -> bool:
        return self._three is not None and self._three.landed

    def adopt(self, vehicle: Vehicle) -> None:
        """Change the vehicle's parameters; a landing keeps the old ones."""
        self._adopt_laws(vehicle)
        self.watch.adopt(vehicle)

    def has_designed(self, vehicle: Vehicle) -> bool:
        """Whether the laws for a vehicle are designed, or cannot be; if not, design one of them, in some ms."""
        if self._interval_s > MAX_INTERVAL_S or not _lands(vehicle):
            return True
        if vehicle != self._designing:
            self._designing, self._designed = vehicle, 0
        if self._designed == _FOUR:
            return True
        try:
            law_without(vehicle, self._designed, self._interval_s)
            self._designed += 1
        except ThreeRotorsError:
            self._designed = _FOUR
        return False

    def try_out(self, vehicle: Vehicle) -> None:
        """Raise a ThreeRotorsError if a changed vehicle cannot land, but the present one can."""
        trial = RotorLoss(vehicle, round(self._interval_s * 1e6))
        if trial.impossible and not self.impossible:
            raise ThreeRotorsError(f"no landing on three rotors: {trial.impossible}")
        controls = (vehicle.hover_speed / vehicle.rotors.max_speed,) * vehicle.rotors.count
        for _ in range(2):
            trial.look(AT_REST, controls, 0.0, airborne=True, ground_m=-1.0)
        if not isfinite(trial.watch.max_evidence):
            raise ThreeRotorsError("no rotor can be watched")
        for lost in () if trial.impossible else range(len(trial._laws)):
            trial.resume(lost, trial.watch.speeds, AT_REST, -1.0, flying=True)
            if not all(0.0 <= control <= 1.0 for control in trial.decide(AT_REST, 0.0)[0]):
                raise ThreeRotorsError(f"no law flies it without rotor {lost + 1}")

    def obey(self, permission: Permission) -> None:
        self.enabled, self._lands_always = permission.rotor_failure > 0, permission.rotor_failure > 1
        if not self.enabled:
            self.forget()

    def begin(self, controls: PerRotor) -> None:
        self.watch.begin(controls)

    def resume(self, lost: int, speeds: Array, state: VehicleState, ground_m: float, *, flying: bool) -> None:
        self.watch.lost, self.watch.speeds = lost, speeds
        if not _lands(self._vehicle):
            self.rebuild(lost)
        elif flying and not self.impossible:
            self._take_over(lost, state, ground_m)

    def forget(self) -> None:
        if self.watch.lost is not None and not _lands(self._vehicle):
            self.rebuild(None)
        self.watch.lost = None
        self._three = None

    def look(
        self, state: VehicleState, controls: PerRotor, charge_ah: float, *, airborne: bool, ground_m: float
    ) -> bool:
        """Process a control sample; return whether a loss was detected in it."""
        if self.watch.lost is not None:
            return False
        watches = self.enabled and not self.impossible
        _, x, y, _ = state.attitude
        clear_m = _CLEAR_M if x * x + y * y < 0.5 else _CLEAR_INVERTED_M
        clear = watches and airborne and state.position_enu_m[2] - ground_m > clear_m
        lost = self.watch.step(state, controls, charge_ah, airborne=clear)
        if lost is None:
            return False
        if _lands(self._vehicle):
            self._take_over(lost, state, ground_m)
        else:
            self.rebuild(lost)
        return True

    def decide(self, state: VehicleState, charge_ah: float) -> tuple[PerRotor, Decision]:
        assert self._three is not None, "decided only while three rotors fly"
        decision = self._three.step(state, charge_ah)
        return self._three.controls, decision

    def end(self) -> None:
        self._three = None

    def _adopt_laws(self, vehicle: Vehicle) -> None:
        self._vehicle, self.impossible = vehicle, ""
        if self._interval_s > MAX_INTERVAL_S:
            self.impossible = f"the control law decides only every {self._interval_s:g} s"
            return
        try:
            self._laws = laws_of(vehicle, self._interval_s)
        except ThreeRotorsError as error:
            self.impossible = str(error)

    def _take_over(self, lost: int, state: VehicleState, ground_m: float) -> None:
        self._three = ThreeRotors(self._vehicle, self._laws[lost], self._interval_s, self.watch.speeds, state, ground_m)
