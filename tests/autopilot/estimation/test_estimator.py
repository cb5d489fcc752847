"""The estimator on synthetic flights: how it begins, how well it knows, and what it does when sensors fail."""

from collections.abc import Callable
from dataclasses import replace
from math import hypot, inf, nan

import numpy as np
import pytest

from colibri.autopilot.estimation.estimate import Estimate
from colibri.autopilot.estimation.sensing.rejection import Reason, RejectedSource
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, geodetic_of
from colibri.common.rotations import earth_from_body
from colibri.mavlink.hil.sensors import GpsFix, SensorFrame, Updated
from colibri.mavlink.wire.dialect import mav
from tests.support import sensor_source as source
from tests.support.estimates import Change, at, error_m, estimates, estimator, known, last, parts, recorded
from tests.support.sensor_source import INTERVAL_US, Faults


def max_jump_m(of: list[Estimate | None]) -> float:
    positions = np.array([one.frame.position_enu_m for one in known(of)])
    velocities = np.array([one.frame.velocity_enu_m_s for one in known(of)])
    steps = np.diff(positions, axis=0) - velocities[1:] * INTERVAL_US * 1e-6
    return float(np.linalg.norm(steps, axis=1).max())


@pytest.mark.parametrize("settles", [True, False])
def test_a_queued_frame_changes_no_bit(settles: bool) -> None:
    frames = list(recorded(source.climb, 1, 3.0).frames)
    frames = [frame for k, frame in enumerate(frames) if k % 97 not in (3, 4)]
    frames.insert(600, frames[590])
    at_once, queueing = estimator(), estimator()
    for k, frame in enumerate(frames):
        if k % 2:
            at_once.receive(frame)
            at_once.advance()
            queueing.receive(frame)
        else:
            assert at_once.step(frame) == queueing.step(frame)
        if settles:
            queueing.settle()
    if not settles:  # which brings the filter on
        assert at_once.record() == queueing.record()


def test_it_begins_after_a_second_of_rest_with_a_fix() -> None:
    flight = recorded(source.climb, 1, 3.0)
    first = next(one for one in estimates(flight.frames) if one is not None)
    assert 1.0 <= first.frame.time_us * 1e-6 <= 1.2
    assert first.health.flags == (
        mav.ESTIMATOR_ATTITUDE
        | mav.ESTIMATOR_VELOCITY_HORIZ
        | mav.ESTIMATOR_VELOCITY_VERT
        | mav.ESTIMATOR_POS_HORIZ_REL
        | mav.ESTIMATOR_POS_HORIZ_ABS
        | mav.ESTIMATOR_POS_VERT_ABS
        | mav.ESTIMATOR_PRED_POS_HORIZ_REL
        | mav.ESTIMATOR_PRED_POS_HORIZ_ABS
    )
    assert not first.rejected


def turned(frame: SensorFrame, _: float) -> SensorFrame:
    p, q, r = frame.rate_flu_rad_s
    return frame._replace(rate_flu_rad_s=(p, q, r + 0.5))


def shaken(frame: SensorFrame, t: float) -> SensorFrame:
    x, y, z = frame.specific_force_flu_m_s2
    return frame._replace(specific_force_flu_m_s2=(x + 2.0 * np.sin(40.0 * t), y, z))


def magnetised(frame: SensorFrame) -> SensorFrame:
    x, y, z = frame.magnetic_field_flu_gauss
    return frame._replace(magnetic_field_flu_gauss=(x, y + 0.3, z))


def told(lie: Callable[[GpsFix], GpsFix]) -> Callable[[SensorFrame], SensorFrame]:
    return lambda frame: frame if frame.gps is None else frame._replace(gps=lie(frame.gps))


def moved(east_m: float) -> Callable[[SensorFrame], SensorFrame]:
    return told(lambda fix: replace(fix, place=geodetic_of((east_m, 0.0, 0.0), fix.place)))


def since(from_s: float, change: Callable[[SensorFrame], SensorFrame], until_s: float = inf) -> Change:
    return lambda frame, t: change(frame) if from_s <= t < until_s else frame


@pytest.mark.parametrize(
    "change",
    [
        turned,
        lambda frame, _: frame._replace(gps=None),
        lambda frame, _: frame._replace(updated=frame.updated & ~int(Updated.MAGNETOMETER)),
        shaken,
    ],
    ids=["turned", "without a fix", "without a magnetometer", "shaken"],
)
def test_it_does_not_begin(change: Change) -> None:
    assert not known(estimates(recorded(source.climb, 1, 3.0).frames, change))


def test_biases_are_found_within_half_a_minute_of_flight() -> None:
    wrong = Faults(gyro_bias_rad_s=(0.02, -0.02, 0.02), accel_bias_m_s2=(0.3, -0.3, 0.3))
    flight = recorded(source.circle, 3, source.REST_S + 30.0, wrong)
    learned = last(estimates(flight.frames))
    assert learned.gyro_bias_rad_s == pytest.approx(flight.gyro_bias[-1], abs=5e-4)
    assert learned.accel_bias_m_s2 == pytest.approx(flight.accel_bias[-1], abs=0.02)


def test_state_is_that_of_now_and_not_that_of_the_last_fix() -> None:
    """At 3 m/s the delay of GPS alone would be 0.36 m, and its velocity's 0.5 m/s."""
    flight = recorded(source.circle, 5, 30.0)
    of = estimates(flight.frames)
    late = range(5000, len(of))
    velocity = [np.subtract(flight.motion.velocity[k], of[k].frame.velocity_enu_m_s) for k in late]  # type: ignore[union-attr]
    position = np.array([np.subtract(flight.motion.position[k], of[k].frame.position_enu_m) for k in late])  # type: ignore[union-attr]
    assert np.sqrt(np.mean(np.square(velocity), axis=0)).max() < 0.03
    assert position.std(axis=0).max() < 0.1


def test_a_stationary_covariance_is_not_too_small() -> None:
    deviation_m = last(estimates(recorded(source.hover, 2, 20.0).frames)).position_std_m
    gps = parts().gps
    assert 0.5 * gps.horizontal_drift_m < min(deviation_m[:2])
    assert max(deviation_m) < 2.0 * gps.horizontal_drift_m


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 5))])
def test_a_hover_without_gps_drifts_and_recovers_smoothly(seed: int) -> None:
    flight = recorded(source.hover, seed, 70.0, Faults(gps_lost_s=(30.0, 50.0)))
    of = estimates(flight.frames)
    lost, found = at(of, 49.9), last(of)
    assert error_m(flight, of, 49.9) < 20.0
    assert error_m(flight, of, 49.9) < 4.0 * float(np.linalg.norm(lost.position_std_m))
    assert lost.health.dead_reckoning
    assert lost.health.gps_lost_since_us == pytest.approx(29.9e6, abs=2e5)
    assert lost.health.attitude
    assert not found.health.dead_reckoning
    assert found.health.gps_lost_since_us is None
    assert error_m(flight, of, 69.9) < 1.5
    assert max_jump_m(of[round(35e6 / INTERVAL_US) :]) < 0.06


def test_a_glitch_is_not_followed() -> None:
    flight = recorded(source.hover, 8, 20.0)
    of = estimates(flight.frames, since(10.0, moved(50.0), 15.0))
    during, after = at(of, 14.0), last(of)
    assert during.health.gps_glitch
    assert not during.health.dead_reckoning
    assert max(error_m(flight, of, t) for t in np.arange(9.0, 20.0, 0.5)) < 1.5
    assert after.rejected == {(RejectedSource.GPS, Reason.INNOVATION): 50}
    assert after.resets == 0


def test_what_gps_says_for_long_is_believed_without_a_jump() -> None:
    of = estimates(recorded(source.hover, 8, 32.0).frames, since(10.0, moved(5.0)))
    after = last(of)
    assert after.resets == 1
    assert after.frame.position_enu_m[0] == pytest.approx(5.0, abs=1.0)
    assert hypot(*after.smoothing_m) < 0.05
    assert max_jump_m(of) < 0.06


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"fix_type": 1}, Reason.NO_FIX),
        ({"fix_type": 255}, Reason.NO_FIX),
        ({"time_us": 0}, Reason.TIME),
        ({"time_us": 1 << 62}, Reason.TIME),
        ({"velocity_enu_m_s": (nan, 0.0, 0.0)}, Reason.NOT_FINITE),
        ({"velocity_enu_m_s": (1e6, 0.0, 0.0)}, Reason.RANGE),
        ({"place": DEFAULT_ORIGIN._replace(latitude_deg=91.0)}, Reason.RANGE),
        ({"place": DEFAULT_ORIGIN._replace(altitude_m=1e6)}, Reason.RANGE),
        ({"place": DEFAULT_ORIGIN._replace(longitude_deg=100.0)}, Reason.INNOVATION),
    ],
)
def test_an_impossible_fix_is_counted(change: dict[str, object], reason: Reason) -> None:
    spoilt = told(lambda fix: replace(fix, **change))  # type: ignore[arg-type]
    after = last(estimates(recorded(source.hover, 4, 5.0).frames, since(3.0, spoilt)))
    assert set(after.rejected) == {(RejectedSource.GPS, reason)}
    assert after.health.gps_lost_since_us is not None


def test_a_magnet_nearby_does_not_turn_it() -> None:
    flight = recorded(source.hover, 2, 30.0)
    of = estimates(flight.frames, since(8.0, magnetised))
    during, after = at(of, 12.0), last(of)
    assert RejectedSource.MAGNETOMETER in during.health.not_accepted
    assert during.health.heading
    assert set(during.rejected) == {(RejectedSource.MAGNETOMETER, Reason.FIELD)}
    assert RejectedSource.MAGNETOMETER not in after.health.not_accepted
    assert after.resets == 1
    ahead = earth_from_body(after.frame.attitude, (1.0, 0.0, 0.0))
    assert np.dot(ahead, flight.motion.attitude[-1][:, 0]) > np.cos(np.radians(1.0))


def test_a_barometer_that_jumps_does_not_lift_it() -> None:
    flight = recorded(source.hover, 2, 25.0)
    jump = since(10.0, lambda frame: frame._replace(pressure_pa=frame.pressure_pa - 300.0))
    of = estimates(flight.frames, jump)
    during, after = at(of, 14.0), last(of)
    assert RejectedSource.BAROMETER in during.health.not_accepted
    assert during.health.height
    assert RejectedSource.BAROMETER not in after.health.not_accepted
    assert after.resets == 1
    assert max(error_m(flight, of, t) for t in np.arange(9.0, 25.0, 0.5)) < 1.0


def test_a_stuck_barometer_is_seen() -> None:
    flight = recorded(source.climb, 2, 14.0)
    of = estimates(flight.frames, since(6.0, lambda frame: frame._replace(pressure_pa=95000.0)))
    assert last(of).rejected[RejectedSource.BAROMETER, Reason.FROZEN] > 300
    assert RejectedSource.BAROMETER in last(of).health.not_accepted
    assert error_m(flight, of, 13.9) < 1.0


def test_a_stuck_receiver_is_not_fused() -> None:
    flight = recorded(source.climb, 2, 14.0)
    last_fix = [frame.gps for frame in flight.frames if frame.gps and frame.time_us < 5.5e6][-1]

    def stuck(frame: SensorFrame) -> SensorFrame:
        return frame._replace(gps=frame.gps and replace(last_fix, time_us=frame.gps.time_us))

    of = estimates(flight.frames, since(5.5, stuck))
    assert at(of, 6.6).health.gps_lost_since_us == last_fix.time_us


@pytest.mark.parametrize("bad", [nan, float("inf"), 1e6, -1e6])
def test_short_nonsense_of_inertial_sensors_is_bridged(bad: float) -> None:
    def nonsense(frame: SensorFrame) -> SensorFrame:
        return frame._replace(rate_flu_rad_s=(bad, 0.0, 0.0), specific_force_flu_m_s2=(0.0, 0.0, bad))

    flight = recorded(source.circle, 2, 20.0)
    of = estimates(flight.frames, since(12.0, nonsense, 12.02))
    assert max(error_m(flight, of, t) for t in np.arange(11.0, 20.0, 0.25)) < 1.0


@pytest.mark.parametrize("axes", ["rate_flu_rad_s", "specific_force_flu_m_s2"])
def test_a_frozen_inertial_sensor_is_told(axes: str) -> None:
    frozen = since(5.0, lambda frame: frame._replace(**{axes: (0.01, 0.02, 0.03)}))
    after = last(estimates(recorded(source.hover, 2, 7.0).frames, frozen))
    assert sum(count for (_, reason), count in after.rejected.items() if reason is Reason.FROZEN) > 400
    assert after.health.gyroscope == (axes != "rate_flu_rad_s")
    assert after.health.accelerometer == (axes == "rate_flu_rad_s")


def test_repeated_and_backward_frames_change_nothing() -> None:
    frames = recorded(source.circle, 6, 10.0).frames
    disturbed: list[SensorFrame] = []
    for k, frame in enumerate(frames):
        disturbed += [frame, frame, frames[k // 2]] if k % 7 == 0 else [frame]
    other = last(estimates(disturbed))
    assert other.frame == last(estimates(frames)).frame
    assert set(other.rejected) == {(RejectedSource.CLOCK, Reason.TIME)}


def test_one_frame_from_far_ahead_is_a_stray() -> None:
    frames = recorded(source.circle, 6, 10.0).frames
    of = estimates([*frames[:1000], frames[1000]._replace(time_us=1 << 60), *frames[1000:]])
    assert all(one is not None for one in of[1000:])


def test_a_clock_begun_anew_begins_the_estimator_anew() -> None:
    frames = recorded(source.climb, 6, 3.0).frames
    of = estimates([*frames, *frames])
    again = of[len(frames) :]
    assert again[0] == of[len(frames) - 1]
    assert again[30] is None
    assert last(again).frame.time_us == frames[-1].time_us


def test_lost_frames_are_crossed() -> None:
    flight = recorded(source.circle, 6, 20.0)
    kept = [frame for k, frame in enumerate(flight.frames) if k < 1500 or k % 5 < 3]
    after = last(estimates(kept)).frame
    assert np.linalg.norm(flight.motion.position[after.time_us // INTERVAL_US] - after.position_enu_m) < 1.0


def test_a_sensor_that_has_nothing_new_is_not_measured_again() -> None:
    def everything(frame: SensorFrame, _: float) -> SensorFrame:
        return frame._replace(updated=0x1FFF)

    held: list[SensorFrame] = []
    for frame in recorded(source.hover, 2, 5.0).frames:
        before = held[-1] if held else frame
        field = frame if frame.has(Updated.MAGNETOMETER) else before
        pressure = frame if frame.has(Updated.BAROMETER) else before
        held.append(
            frame._replace(magnetic_field_flu_gauss=field.magnetic_field_flu_gauss, pressure_pa=pressure.pressure_pa)
        )
    assert last(estimates(held)) == estimates(held, everything)[-1]
