"""Whatever sensors say, the estimator stays finite, its covariance positive, and it counts what it rejects."""

from dataclasses import replace
from math import inf, isfinite, nan

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from colibri.autopilot.estimation.estimate import Estimate
from colibri.autopilot.estimation.estimator import Estimator
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic
from colibri.mavlink.hil.sensors import GpsFix, SensorFrame
from colibri.plant.vehicle.description import load_vehicle
from tests.support import sensor_source as source

_SENSORS = load_vehicle("hummingbird").sensors
assert _SENSORS is not None
_FRAMES = source.record(source.circle, _SENSORS, 1, 12.0).frames

NUMBERS = st.one_of(st.sampled_from([nan, inf, -inf, 0.0, 1e6, -1e6, 1e308, -1e308, 5e-324, 200.0, -30.0]), st.floats())
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS)
TIMES = st.one_of(st.integers(-(1 << 63), 1 << 64), st.sampled_from([0, 1, -1]))
FIXES = st.builds(
    GpsFix,
    time_us=TIMES,
    fix_type=st.integers(0, 255),
    place=st.builds(Geodetic, NUMBERS, NUMBERS, NUMBERS),
    velocity_enu_m_s=VECTORS,
    horizontal_accuracy_m=NUMBERS,
    vertical_accuracy_m=NUMBERS,
    satellites=st.integers(0, 255),
)


class HostileSensors(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        assert _SENSORS is not None
        self.estimator = Estimator(_SENSORS, source.GRAVITY_M_S2, DEFAULT_ORIGIN, source.INTERVAL_US)
        self.last: Estimate | None = None
        self.at = 0
        self.ahead_us = 0

    def feed(self, frame: SensorFrame) -> None:
        self.last = self.estimator.step(frame)

    @initialize()
    def take_off(self) -> None:
        for frame in _FRAMES[:500]:
            self.feed(frame)
        self.at = 500

    def next_frame(self) -> SensorFrame:
        frame = _FRAMES[self.at % len(_FRAMES)]
        lap_us = self.at // len(_FRAMES) * len(_FRAMES) * source.INTERVAL_US + self.ahead_us
        self.at += 1
        gps = frame.gps and replace(frame.gps, time_us=frame.gps.time_us + lap_us)
        return frame._replace(time_us=frame.time_us + lap_us, gps=gps)

    @rule(count=st.integers(1, 100))
    def fly(self, count: int) -> None:
        for _ in range(count):
            self.feed(self.next_frame())

    @rule(
        count=st.integers(1, 60),
        force=st.none() | VECTORS,
        rate=st.none() | VECTORS,
        field=st.none() | VECTORS,
        pressure=st.none() | NUMBERS,
        updated=st.none() | st.integers(0, (1 << 32) - 1),
    )
    def measure_anything(self, count: int, force, rate, field, pressure, updated) -> None:  # type: ignore[no-untyped-def]
        for _ in range(count):
            frame = self.next_frame()
            self.feed(
                frame._replace(
                    specific_force_flu_m_s2=force or frame.specific_force_flu_m_s2,
                    rate_flu_rad_s=rate or frame.rate_flu_rad_s,
                    magnetic_field_flu_gauss=field or frame.magnetic_field_flu_gauss,
                    pressure_pa=frame.pressure_pa if pressure is None else pressure,
                    updated=frame.updated if updated is None else updated,
                )
            )

    @rule(fix=FIXES, now=st.booleans())
    def tell_any_fix(self, fix: GpsFix, now: bool) -> None:
        frame = self.next_frame()
        self.feed(frame._replace(gps=replace(fix, time_us=frame.time_us) if now else fix))

    @rule(time_us=TIMES, count=st.integers(1, 40))
    def tell_any_time(self, time_us: int, count: int) -> None:
        for k in range(count):
            self.feed(_FRAMES[self.at % len(_FRAMES)]._replace(time_us=time_us + k * source.INTERVAL_US))

    @rule(frames=st.integers(1, 300))
    def lose_frames(self, frames: int) -> None:
        self.at += frames

    @rule(gap_us=st.integers(1, 3_000_000))
    def stop_the_clock(self, gap_us: int) -> None:
        self.ahead_us += gap_us

    @invariant()
    def all_is_finite(self) -> None:
        if self.last is None:
            return
        frame = self.last.frame
        numbers = (
            *frame.position_enu_m,
            *frame.velocity_enu_m_s,
            *frame.attitude,
            *frame.rate_flu_rad_s,
            *self.last.position_std_m,
            *self.last.velocity_std_m_s,
            *self.last.attitude_std_rad,
            *self.last.gyro_bias_rad_s,
            *self.last.accel_bias_m_s2,
            *self.last.smoothing_m,
        )
        assert all(map(isfinite, numbers)), self.last
        assert abs(np.linalg.norm(frame.attitude) - 1.0) < 1e-9

    @invariant()
    def covariance_is_positive(self) -> None:
        P = self.estimator.filter.P
        if self.last is None:
            return
        sigma = np.sqrt(np.diag(P))
        assert (sigma > 0.0).all()
        assert np.abs(P - P.T).max() <= 1e-9 * sigma.max() ** 2
        np.linalg.cholesky(0.5 * (P + P.T) / np.outer(sigma, sigma))


HostileSensors.TestCase.settings = settings(max_examples=30, stateful_step_count=20)
TestHostileSensors = HostileSensors.TestCase
