"""The loss of a rotor: detected, and the vehicle landed on the other three, whatever control law flew before."""

from functools import lru_cache
from math import isfinite
from typing import Protocol, TypeAlias

from colibri.autopilot.control.interface import AT_REST, Decision, VehicleState
from colibri.autopilot.control.rotor_loss.detector import RotorWatch
from colibri.autopilot.control.rotor_loss.reduced_attitude import ReducedAttitude, ThreeRotorsError
from colibri.autopilot.control.rotor_loss.three_rotors import ThreeRotors, law_without
from colibri.common.types import Array, FourRotors
from colibri.plant.vehicle.description import Vehicle

MAX_INTERVAL_S = 0.02
"""A vehicle that spins at four turns a second turns half a radian in so long: who decides less often cannot do it."""
_CLEAR_M = 0.3
"""Closer to the ground than this it may touch, and the ground pushes as a rotor does."""

Laws: TypeAlias = tuple[ReducedAttitude, ...]
"""Of a vehicle's attitude without each of its rotors, (4,)."""


@lru_cache(maxsize=4)
def laws_of(vehicle: Vehicle, interval_s: float) -> Laws:
    """Return the laws of a vehicle, each built once; ThreeRotorsError if there are none."""
    return tuple(law_without(vehicle, lost, interval_s) for lost in range(4))


class Permission(Protocol):
    """The conditions under which a vehicle may be landed on three rotors."""

    @property
    def land_on_three(self) -> bool:
        """Whether a rotor that is lost is noticed, and the vehicle landed on the others."""
        ...


class RotorLoss:
    """Watches the rotors of one vehicle, and flies it once one is lost.

    Attributes:
        enabled: Whether anything is done, or noticed.
        impossible: Why the vehicle cannot be landed on three rotors; empty if it can.
    """

    def __init__(self, vehicle: Vehicle, interval_us: int) -> None:
        self._interval_s = interval_us * 1e-6
        self._adopt_laws(vehicle)
        self.watch = RotorWatch(vehicle, self._interval_s)
        self._three: ThreeRotors | None = None
        self.enabled = True

    @property
    def lost(self) -> int | None:
        """The rotor that is lost, 0..3; None while all turn, as far as is known."""
        return self.watch.lost

    @property
    def flies(self) -> bool:
        """Whether the vehicle is flown on three rotors now."""
        return self._three is not None and not self._three.landed

    @property
    def landed(self) -> bool:
        """Whether it has come down on three rotors."""
        return self._three is not None and self._three.landed

    def adopt(self, vehicle: Vehicle) -> None:
        """Go on with other numbers of the vehicle; one that is flown on three rotors goes on with those it has."""
        self._adopt_laws(vehicle)
        self.watch.adopt(vehicle)

    def try_out(self, vehicle: Vehicle) -> None:
        """Lose each rotor of a vehicle of other numbers in hover, for two samples; nothing is kept but its laws.

        Raises:
            ThreeRotorsError: It cannot be landed on three rotors, where the one that is flown can.
        """
        trial = RotorLoss(vehicle, round(self._interval_s * 1e6))
        if trial.impossible and not self.impossible:
            raise ThreeRotorsError(f"no landing on three rotors: {trial.impossible}")
        hover = vehicle.hover_speed / vehicle.rotors.max_speed
        controls = (hover, hover, hover, hover)
        for _ in range(2):
            trial.look(AT_REST, controls, 0.0, airborne=True, ground_m=-1.0)
        if not isfinite(trial.watch.max_evidence):
            raise ThreeRotorsError("no rotor can be watched")
        for lost in () if trial.impossible else range(4):
            trial.resume(lost, trial.watch.speeds, AT_REST, -1.0, flying=True)
            if not all(0.0 <= control <= 1.0 for control in trial.decide(AT_REST, 0.0)[0]):
                raise ThreeRotorsError(f"no law flies it without rotor {lost + 1}")

    def obey(self, permission: Permission) -> None:
        """Watch, and land on three rotors, from now on only where that is allowed."""
        self.enabled = permission.land_on_three
        if not self.enabled:
            self.forget()

    def begin(self, controls: FourRotors) -> None:
        """Begin after frames that were missed, the rotors turning at `controls`."""
        self.watch.begin(controls)

    def resume(self, lost: int, speeds: Array, state: VehicleState, ground_m: float, *, flying: bool) -> None:
        """Go on after a restart without a rotor that was lost before, the others turning at `speeds`."""
        self.watch.lost, self.watch.speeds = lost, speeds
        if flying and not self.impossible:
            self._take_over(lost, state, ground_m)

    def forget(self) -> None:
        """Take all rotors for whole again."""
        self.watch.lost = None
        self._three = None

    def look(
        self, state: VehicleState, controls: FourRotors, charge_ah: float, *, airborne: bool, ground_m: float
    ) -> bool:
        """Take in a control sample; return whether a rotor is known to be lost since this very one.

        Args:
            controls: What the rotors were commanded to since the sample before, parts of the largest speed.
            airborne: Whether nothing but air touches the vehicle.
            ground_m: Height of the ground, z of ENU, as far as it is known.
        """
        if not self.enabled or self.impossible or self.watch.lost is not None:
            return False
        clear = airborne and state.position_enu_m[2] - ground_m > _CLEAR_M
        lost = self.watch.step(state, controls, charge_ah, airborne=clear)
        if lost is None:
            return False
        self._take_over(lost, state, ground_m)
        return True

    def decide(self, state: VehicleState, charge_ah: float) -> tuple[FourRotors, Decision]:
        """Return the controls to hold until the next control sample, and the decision that they are."""
        assert self._three is not None, "decided only while three rotors fly"
        decision = self._three.step(state, charge_ah)
        return self._three.controls, decision

    def end(self) -> None:
        """Stop flying on three rotors; what is lost stays lost."""
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
