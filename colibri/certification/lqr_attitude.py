"""The law of a profile that is certified: the LQR of `lpv-mpc`, to which its terminal weight and fallback belong."""

from math import exp, radians, tan
from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.lpv_mpc.attitude_mpc import AttitudeMpc, body_of
from colibri.autopilot.control.lpv_mpc.law import LpvMpcSettings
from colibri.autopilot.control.lpv_mpc.outer_loop import OuterLoop
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.qp import QpSolver
from colibri.autopilot.control.vehicle_model.battery import BatteryModel
from colibri.autopilot.control.vehicle_model.rotor_lag import rotor_lag
from colibri.certification.attitude import AttitudeNumbers, attitude_loop
from colibri.certification.loop import Number, UncertainLoop
from colibri.common.config import read_settings
from colibri.common.elementary import square
from colibri.common.errors import Error
from colibri.plant.vehicle.description import Vehicle

LAW = "lpv-mpc"
_DIGITS = 10
"""Of numbers that are chosen here: short ones keep exact arithmetic short."""


class UncertifiableError(Error):
    """A profile whose law cannot be certified."""


class Conditions(NamedTuple):
    """What a certificate is to hold for.

    Attributes:
        disturbance_n_m: Length of the moment that disturbs.
        charge_part: Part of the battery's charge that may be taken.
    """

    disturbance_n_m: float
    charge_part: float


class LqrAttitude:
    """The LQR of a profile's attitude.

    Attributes:
        mpc: The law's attitude controller.
        body: Its model of the vehicle.
        interval_s: The control sample.
        conditions: What its certificate is to hold for.
        thrust_n: Of a hover, and the ends of the profile's range, N.
    """

    def __init__(self, profile: Profile, vehicle: Vehicle, conditions: Conditions) -> None:
        """Take the law from the profile.

        Raises:
            UncertifiableError: The profile has no numbers for it.
            SettingsError: Its table is wrong.
        """
        if not profile.table(LAW):
            raise UncertifiableError(f"{profile.where}: has no numbers for {LAW}: only that law can be certified")
        settings = read_settings(profile.table(LAW), LpvMpcSettings)
        self.interval_s = settings.control_interval_s
        self._settings, self._vehicle, self.conditions = settings.attitude, vehicle, conditions
        lag = rotor_lag(vehicle, self.interval_s)
        solver = QpSolver(settings.qp.solver, settings.qp.tolerance, settings.qp.max_iterations)
        self.mpc = AttitudeMpc(settings.attitude, vehicle, lag, solver, self.interval_s, lambda: 0.0)
        self.body = body_of(vehicle)
        capacity_ah = vehicle.battery.capacity_ah if vehicle.battery else 0.0
        self._max_squared = square(BatteryModel(vehicle).max_common_speed(conditions.charge_part * capacity_ah))
        outer_loop = OuterLoop(settings.guidance, vehicle, lag, self.interval_s, self.mpc.horizon)
        limits = outer_loop.limits(self._max_squared**0.5)
        hover_n = vehicle.body.mass_kg * vehicle.gravity_m_s2
        self.thrust_n = (limits.min_n, hover_n, limits.max_n)

    def loop(self, numbers: AttitudeNumbers, number: Number) -> UncertainLoop:
        """Return the loop of these numbers, in floats or in fractions."""
        return attitude_loop(numbers, number)

    def thrusts_n(self, scale: float) -> tuple[float, float]:
        """Return the range of the thrust: from that of a hover towards both ends of the profile's, by this part."""
        low, hover, high = self.thrust_n
        return hover - scale * (hover - low), hover + scale * (high - hover)

    def numbers_at(self, scale: float) -> AttitudeNumbers:
        """Return the numbers of the loop whose ranges are this part of the profile's."""
        vehicle, problem, body = self._vehicle, self.mpc.problem, self.body
        rotors = vehicle.rotors
        least, most = self.thrusts_n(scale)
        squared = problem.from_thrust
        headroom = min(self._max_squared - max(squared * most), min(squared * least) - problem.min_squared)
        speeds = self._max_squared**0.5 - problem.min_squared**0.5
        momentum = abs(vehicle.rotor_momentum()).sum() / 2 * speeds * rotors.max_speed
        angle = radians(self._settings.max_angle_deg) * scale
        lag_s = 1.0 / body.lag_1_s if body.lag_1_s else 0.0
        return AttitudeNumbers(
            interval_s=self.interval_s,
            lag_s=lag_s,
            stays=exp(-self.interval_s / lag_s) if lag_s else 0.0,
            inertia_kg_m2=[body.ix, body.iy, body.iz],
            gain=self.mpc.gain.tolist(),
            half_tangents=[round(tan(angle / 2), _DIGITS)] * 2,
            rates_rad_s=[round(scale * rate, _DIGITS) for rate in self._settings.max_rate_rad_s],
            momentum_n_m_s=round(momentum, _DIGITS),
            max_increment_n_m=list(self._settings.max_increment_n_m),
            from_moments=problem.from_moments.tolist(),
            to_moments=(vehicle.allocation()[1:] * square(rotors.max_speed)).tolist(),
            headroom=round(float(headroom), _DIGITS),
            disturbance_n_m=self.conditions.disturbance_n_m,
            output_weight=np.asarray(problem.output_weight).tolist(),
            increment_weight=np.asarray(problem.increment_weight).tolist(),
        )
