"""The plant's sensors: what they tell of a world, when, and what it depends on."""

from collections.abc import Iterator, Sequence
from math import cos, sin
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.common.earth.atmosphere import altitude_m, pressure_pa, temperature_c
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic, enu_of
from colibri.common.earth.magnetic_field import field_enu_gauss
from colibri.common.rotations import earth_from_body, quaternion_from_euler
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.hil.sensors import GpsFix, SensorFrame, Updated
from colibri.plant.environment.weather import NO_WEATHER
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, World, starting_world
from colibri.plant.sensors.instrument import Rate
from colibri.plant.sensors.suite import SensorSuite
from colibri.plant.vehicle.description import load_vehicle
from colibri.plant.vehicle.sensors import Sensors
from tests.support.plant_flights import OFF, command, flight, hummingbird, rpm
from tests.support.strategies import quaternions, reals

HUMMINGBIRD = load_vehicle("hummingbird")
PHYSICS = Physics(HUMMINGBIRD, "rk4")
GRAVITY = (0.0, 0.0, HUMMINGBIRD.gravity_m_s2)
FRAME_US = 4000
FLAWS = ("noise", "walk", "turn_on", "iron", "drift_m", "drift_pa")


def parts(**changes: dict[str, Any]) -> Sensors:
    assert HUMMINGBIRD.sensors is not None
    changed = {
        name: msgspec.structs.replace(getattr(HUMMINGBIRD.sensors, name), **numbers)
        for name, numbers in changes.items()
    }
    return msgspec.structs.replace(HUMMINGBIRD.sensors, **changed)


def flawless() -> Sensors:
    whole = parts()
    without = {
        sensor: {
            field: 0.0
            for field in getattr(whole, sensor).__struct_fields__
            if any(flaw in field for flaw in FLAWS) and field != "drift_time_s"
        }
        for sensor in whole.__struct_fields__
        if getattr(whole, sensor) is not None
    }
    return parts(**without)


def suite(
    sensors: Sensors | None = None, seed: int = 0, interval_us: int = FRAME_US, origin: Geodetic = DEFAULT_ORIGIN
) -> SensorSuite:
    return SensorSuite(sensors or parts(), PHYSICS, origin, seed=seed, interval_us=interval_us)


def standing(attitude: Quaternion = (1.0, 0.0, 0.0, 0.0)) -> World:
    return World(0, (*(0.0,) * 9, *attitude), (0.0,) * 4)


def watch(world: World, sensors: SensorSuite, duration_s: float, interval_us: int = FRAME_US) -> list[SensorFrame]:
    times_us = range(0, round(duration_s * 1e6), interval_us)
    return [sensors.measure(world._replace(time_us=time_us)) for time_us in times_us]


def seldom(seed: int, duration_s: float) -> list[SensorFrame]:
    """Watch a vehicle that stands as often as magnetometer and barometer measure."""
    return watch(standing(), suite(seed=seed, interval_us=20_000), duration_s, 20_000)


def fixes(frames: Sequence[SensorFrame]) -> Iterator[GpsFix]:
    return (frame.gps for frame in frames if frame.gps is not None)


def told(frames: Sequence[SensorFrame], group: int, name: str) -> np.ndarray[Any, Any]:
    return np.array([getattr(frame, name) for frame in frames if frame.has(group)])


# Specific force


@given(quaternions(), st.tuples(reals(20.0), reals(20.0), reals(20.0)))
def test_in_free_fall_without_air_nothing_is_felt(attitude: Quaternion, velocity: Vector) -> None:
    vehicle = hummingbird("rotor-lag")
    world = World(0, (*velocity, 0.0, 0.0, 0.0, 0.0, 0.0, 50.0, *attitude), (0.0,) * 4)
    assert Physics(vehicle, "rk4").specific_force(world) == (0.0, 0.0, 0.0)


def test_on_the_ground_its_push_is_felt() -> None:
    rest = flight(HUMMINGBIRD, Start(), OFF, 1.0)[-1]
    assert PHYSICS.specific_force(rest) == pytest.approx(GRAVITY, abs=1e-6)


def test_specific_force_is_acceleration_without_gravity() -> None:
    fast = Start(z=50.0, phi=20.0, theta=-10.0, vx=8.0, vy=-3.0, p=2.0, q=-1.0, r=1.0, rotors=rpm(HUMMINGBIRD, 400.0))
    order = command(500.0, 450.0, 520.0, 480.0, vehicle=HUMMINGBIRD)
    worlds = flight(HUMMINGBIRD, fast, order, 0.3, frame_us=1000)
    attitudes: list[Quaternion] = [world.state[9:13] for world in worlds]  # type: ignore[misc]
    velocity = np.array(
        [earth_from_body(q, world.state[:3]) for q, world in zip(attitudes, worlds, strict=True)]  # type: ignore[arg-type]
    )
    felt = np.array(
        [earth_from_body(q, PHYSICS.specific_force(world)) for q, world in zip(attitudes, worlds, strict=True)]
    )
    acceleration = np.gradient(velocity, 1e-3, axis=0) + np.array(GRAVITY)
    assert felt[2:-2] == pytest.approx(acceleration[2:-2], abs=2e-3)


# Each sensor


def test_flawless_sensors_tell_the_truth() -> None:
    attitude = quaternion_from_euler(0.1, -0.2, 2.0)
    state = (0.0, 0.0, 0.0, 0.3, -0.2, 0.1, 3.0, -4.0, 12.0, *attitude)
    world = World(0, state, (HUMMINGBIRD.hover_speed,) * 4)
    frames = watch(world, suite(flawless()), 1.0)
    for frame in frames:
        assert frame.specific_force_flu_m_s2 == PHYSICS.specific_force(world)
        assert frame.rate_flu_rad_s == (0.3, -0.2, 0.1)
        assert earth_from_body(attitude, frame.magnetic_field_flu_gauss) == pytest.approx(
            field_enu_gauss(DEFAULT_ORIGIN), abs=1e-12
        )
        assert altitude_m(frame.pressure_pa) == pytest.approx(DEFAULT_ORIGIN.altitude_m + 12.0, abs=1e-6)
        assert frame.temperature_c == temperature_c(DEFAULT_ORIGIN.altitude_m + 12.0)
    for fix in fixes(frames):
        assert enu_of(fix.place, DEFAULT_ORIGIN) == pytest.approx((3.0, -4.0, 12.0), abs=1e-6)
        assert (fix.fix_type, fix.satellites) == (3, 14)


def test_the_magnetometers_iron_stays_and_its_noise_does_not() -> None:
    truth = np.array(suite(flawless()).measure(standing()).magnetic_field_flu_gauss)
    errors = [told(seldom(seed, 4.0), Updated.MAGNETOMETER, "magnetic_field_flu_gauss") - truth for seed in range(60)]
    magnetometer = parts().magnetometer
    assert np.mean([error.std(axis=0) for error in errors]) == pytest.approx(magnetometer.noise_gauss, rel=0.05)
    assert np.std([error.mean(axis=0) for error in errors]) == pytest.approx(magnetometer.hard_iron_gauss, rel=0.15)


def test_the_barometer_drifts_and_is_noisy() -> None:
    truth = pressure_pa(DEFAULT_ORIGIN.altitude_m)
    errors = np.array([told(seldom(seed, 2.0), Updated.BAROMETER, "pressure_pa") - truth for seed in range(200)])
    barometer = parts().barometer
    assert np.diff(errors, axis=1).std() == pytest.approx(barometer.noise_pa * 2**0.5, rel=0.05)
    assert errors.mean(axis=1).std() == pytest.approx(barometer.drift_pa, rel=0.15)


@pytest.mark.parametrize("vehicle", ["hummingbird", "hummingbird-rtk"])
def test_gps_errs_as_it_claims(vehicle: str) -> None:
    sensors = load_vehicle(vehicle).sensors
    assert sensors is not None
    gps = sensors.gps
    places, velocities = [], []
    for seed in range(400):
        fix = next(fixes(watch(standing(), suite(sensors, seed), 0.2)))
        places.append(enu_of(fix.place, DEFAULT_ORIGIN))
        velocities.append(fix.velocity_enu_m_s)
        assert fix.horizontal_accuracy_m == pytest.approx(np.hypot(gps.horizontal_noise_m, gps.horizontal_drift_m))
        assert fix.vertical_accuracy_m == pytest.approx(np.hypot(gps.vertical_noise_m, gps.vertical_drift_m))
    claimed = [fix.horizontal_accuracy_m] * 2 + [fix.vertical_accuracy_m]
    assert np.std(places, axis=0) == pytest.approx(claimed, rel=0.12)
    assert np.std(velocities) == pytest.approx(gps.velocity_noise_m_s, rel=0.06)


@pytest.mark.parametrize(("rate_hz", "interval_us"), [(10.0, 4000), (8.0, 4000), (10.0, 7000), (5.0, 100_000)])
def test_gps_tells_where_the_vehicle_was_its_delay_ago(rate_hz: float, interval_us: int) -> None:
    """Exactly: what is told late between two frames says so."""
    sensors = msgspec.structs.replace(flawless(), gps=msgspec.structs.replace(flawless().gps, rate_hz=rate_hz))
    receiver = suite(sensors, interval_us=interval_us)
    count = 0
    for time_us in range(0, 3_000_000, interval_us):
        fix = receiver.measure(circling(time_us)).gps
        if fix is None:
            continue
        count += 1
        assert 0 <= time_us - fix.time_us < interval_us
        was = circling(fix.time_us - round(sensors.gps.delay_s * 1e6)).state
        assert enu_of(fix.place, DEFAULT_ORIGIN) == pytest.approx(was[6:9], abs=1e-6)
        assert fix.velocity_enu_m_s == pytest.approx(was[:3])
    assert count == pytest.approx((3.0 - sensors.gps.delay_s) * rate_hz, abs=1.0)


def circling(time_us: int) -> World:
    turn = time_us * 1e-6
    state = (-3.0 * sin(turn), 3.0 * cos(turn), 0.0, 0.0, 0.0, 0.0, 3.0 * cos(turn), 3.0 * sin(turn), 5.0)
    return World(time_us, (*state, 1.0, 0.0, 0.0, 0.0), (HUMMINGBIRD.hover_speed,) * 4)


# When, and what it depends on


@given(st.floats(0.5, 400.0), st.integers(1, 50))
def test_a_rate_is_kept_on_average_by_whole_frames(rate_hz: float, interval_ms: int) -> None:
    rate = Rate(rate_hz)
    times_s = [frame * interval_ms * 1e-3 for frame in range(500)]
    due_s = [time_s for time_s in times_s if rate.is_due(round(time_s * 1e6))]
    assert due_s[0] == 0.0
    wanted = min(rate_hz * times_s[-1] + 1, len(times_s))
    assert len(due_s) == pytest.approx(wanted, abs=1.01)


def test_each_comes_at_its_rate() -> None:
    frames = watch(standing(), suite(), 1.0)
    assert sum(frame.has(Updated.MAGNETOMETER) for frame in frames) == 50
    assert sum(frame.has(Updated.BAROMETER) for frame in frames) == 50
    assert all(frame.has(Updated.ACCELEROMETER) and frame.has(Updated.GYROSCOPE) for frame in frames)
    assert [fix.time_us for fix in fixes(frames)] == list(range(120_000, 1_000_000, 100_000))


def test_between_two_samples_the_last_stands() -> None:
    before, after = watch(standing(), suite(), 0.008)
    assert not after.has(Updated.MAGNETOMETER)
    assert not after.has(Updated.BAROMETER)
    assert after.magnetic_field_flu_gauss == before.magnetic_field_flu_gauss
    assert after.pressure_pa == before.pressure_pa


def test_another_seed_errs_otherwise_in_everything() -> None:
    one, other = watch(standing(), suite(seed=5), 0.2), watch(standing(), suite(seed=6), 0.2)
    names = ("specific_force_flu_m_s2", "rate_flu_rad_s", "magnetic_field_flu_gauss", "pressure_pa")
    for a, b in zip(one, other, strict=True):
        assert all(getattr(a, name) != getattr(b, name) for name in names)
    assert next(fixes(one)).place != next(fixes(other)).place


def test_a_frame_asked_for_again_is_the_same_frame() -> None:
    once, twice = suite(), suite()
    for time_us in range(0, 500_000, FRAME_US):
        world = standing()._replace(time_us=time_us)
        frame = twice.measure(world)
        assert twice.measure(world) is frame
        assert frame == once.measure(world)


def test_the_wind_of_the_moment_is_felt() -> None:
    turbulent = Physics(HUMMINGBIRD, "rk4", NO_WEATHER._replace(turbulence="light"))
    still = starting_world(Start(z=50.0), HUMMINGBIRD)
    assert HUMMINGBIRD.drag is not None
    drag_n_s_m = HUMMINGBIRD.drag.linear_n_s_m[0]
    for wind_m_s in (4.0, -7.0):
        x, y, z = turbulent.specific_force(still._replace(wind_enu_m_s=(wind_m_s, 0.0, 0.0)))
        assert x == pytest.approx(drag_n_s_m * wind_m_s / HUMMINGBIRD.body.mass_kg)
        assert (y, z) == (0.0, 0.0)
