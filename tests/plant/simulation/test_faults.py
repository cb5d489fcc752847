"""Each fault changes what it says, and nothing else, bit for bit."""

from dataclasses import replace
from math import nan
from typing import Any

import pytest

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, enu_of
from colibri.mavlink.hil.faults import (
    ACCELEROMETER,
    BAROMETER,
    BATTERY,
    DELAYED,
    GARBAGE,
    GPS,
    GYROSCOPE,
    MAGNETOMETER,
    MOTOR,
    OFF,
    OK,
    SLOW,
    STUCK,
    WRONG,
    Fault,
)
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.plant_status import NO_BATTERY, FaultResult
from colibri.mavlink.hil.sensors import SensorFrame, Updated
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.wire.dialect import RESULT_ACCEPTED, RESULT_DENIED, RESULT_UNSUPPORTED
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, World, starting_world
from colibri.plant.simulation.plant import Plant
from colibri.plant.vehicle.description import load_vehicle

VEHICLE = load_vehicle("hummingbird")
FRAME_US = 4_000
HOVER = VEHICLE.hover_speed / VEHICLE.rotors.max_speed
COMMAND = ActuatorCommand(0, (HOVER, HOVER, HOVER, HOVER), armed=True)
ASKED_AT = 100
FIELDS = {
    GYROSCOPE: "rate_flu_rad_s",
    ACCELEROMETER: "specific_force_flu_m_s2",
    MAGNETOMETER: "magnetic_field_flu_gauss",
    BAROMETER: "pressure_pa",
    GPS: "gps",
}
GROUPS = {
    GYROSCOPE: Updated.GYROSCOPE,
    ACCELEROMETER: Updated.ACCELEROMETER,
    MAGNETOMETER: Updated.MAGNETOMETER,
    BAROMETER: Updated.BAROMETER,
    GPS: 0,
}


def plant(feedback: Feedback = Feedback.SENSORS, seed: int = 7) -> Plant:
    start = Start(z=20.0, rotors=VEHICLE.hover_speed * VEHICLE.rad_s_per_speed_unit * 9.5492965855)
    physics = Physics(VEHICLE, "rk4")
    world = starting_world(start, VEHICLE)
    return Plant(world, VEHICLE, physics, feedback, DEFAULT_ORIGIN, seed=seed, interval_us=FRAME_US)


def told(*faults: Fault, frames: int = 300, seed: int = 7) -> list[SensorFrame]:
    flown, heard = plant(seed=seed), []
    for number in range(frames):
        frame, _ = flown.measure()
        assert isinstance(frame, SensorFrame)
        heard.append(frame)
        flown.answer(COMMAND, faults if number == ASKED_AT else ())
    return heard


WELL = told()


def without(frame: SensorFrame, unit: int) -> SensorFrame:
    blank: Any = {FIELDS[unit]: None if unit == GPS else 0.0, "updated": frame.updated & ~GROUPS[unit]}
    return frame._replace(**blank)


def of(frame: SensorFrame, unit: int) -> Any:
    return getattr(frame, FIELDS[unit])


@pytest.mark.parametrize("unit", FIELDS)
@pytest.mark.parametrize("kind", [OFF, STUCK, GARBAGE, WRONG, SLOW, DELAYED])
def test_no_other_sensor_changes_and_none_before(unit: int, kind: int) -> None:
    ill = told(Fault(unit, kind))
    assert ill[: ASKED_AT + 1] == WELL[: ASKED_AT + 1]
    assert ill[ASKED_AT + 1 :] != WELL[ASKED_AT + 1 :]
    assert [without(frame, unit) for frame in ill] == [without(frame, unit) for frame in WELL]


@pytest.mark.parametrize("unit", FIELDS)
def test_ok_ends_it(unit: int) -> None:
    assert told(Fault(unit, GARBAGE), Fault(unit, OK)) == WELL


@pytest.mark.parametrize("unit", [GYROSCOPE, ACCELEROMETER, MAGNETOMETER, BAROMETER])
def test_off_tells_nothing_new_and_stuck_the_same_as_if_it_were(unit: int) -> None:
    off, stuck = told(Fault(unit, OFF)), told(Fault(unit, STUCK))
    last = of(WELL[ASKED_AT], unit)
    for frame, well in zip(stuck[ASKED_AT + 1 :], WELL[ASKED_AT + 1 :], strict=True):
        assert of(frame, unit) == last
        assert frame.updated == well.updated
    assert all(of(frame, unit) == last and not frame.has(GROUPS[unit]) for frame in off[ASKED_AT + 1 :])


@pytest.mark.parametrize("unit", [GYROSCOPE, ACCELEROMETER, MAGNETOMETER])
def test_a_bias_is_added_and_a_drift_grows(unit: int) -> None:
    biased, drifting = told(Fault(unit, WRONG, 1, (0.1, -0.2, 0.3, 0.0))), told(Fault(unit, SLOW, 0, (0.5, 0, 0, 0)))
    for number in range(ASKED_AT + 1, 300):
        if not WELL[number].has(GROUPS[unit]):
            continue
        x, y, z = of(WELL[number], unit)
        assert of(biased[number], unit) == (x + 0.1, y - 0.2, z + 0.3)
        elapsed_s = (number - ASKED_AT) * FRAME_US * 1e-6
        assert of(drifting[number], unit) == pytest.approx((x + 0.5 * elapsed_s, y, z))


def test_a_late_sensor_tells_what_it_measured_then() -> None:
    late = told(Fault(GYROSCOPE, DELAYED, 0, (0.1, 0.0, 0.0, 0.0)))
    frames = 100_000 // FRAME_US
    for number in range(ASKED_AT + 1, 300):
        if number > ASKED_AT + frames:
            assert of(late[number], GYROSCOPE) == of(WELL[number - frames], GYROSCOPE)
        else:
            assert of(late[number], GYROSCOPE) == of(WELL[ASKED_AT], GYROSCOPE)
            assert not late[number].has(Updated.GYROSCOPE)


def test_noise_is_of_the_seed_and_as_large_as_asked() -> None:
    noisy = told(Fault(ACCELEROMETER, GARBAGE, 0, (3.0, 0.0, 0.0, 0.0)), frames=1500)
    well = told(frames=1500)
    errors = [
        a - b
        for ill, good in zip(noisy[ASKED_AT + 1 :], well[ASKED_AT + 1 :], strict=True)
        for a, b in zip(of(ill, ACCELEROMETER), of(good, ACCELEROMETER), strict=True)
    ]
    deviation = (sum(error * error for error in errors) / len(errors)) ** 0.5
    assert deviation == pytest.approx(3.0, rel=0.05)
    assert noisy == told(Fault(ACCELEROMETER, GARBAGE, 0, (3.0, 0.0, 0.0, 0.0)), frames=1500)


def test_gps_jumps_by_metres_and_keeps_its_time() -> None:
    jumped = told(Fault(GPS, WRONG, 0, (30.0, -40.0, 5.0, 0.0)))
    pairs = [(a.gps, b.gps) for a, b in zip(jumped, WELL, strict=True) if a.time_us > ASKED_AT * FRAME_US and b.gps]
    assert pairs
    for ill, well in pairs:
        assert ill is not None
        assert well is not None
        assert enu_of(ill.place, well.place) == pytest.approx((30.0, -40.0, 5.0), abs=1e-3)
        assert replace(ill, place=well.place) == well


def test_gps_that_is_stuck_claims_to_be_new() -> None:
    stuck = [frame.gps for frame in told(Fault(GPS, STUCK))[ASKED_AT + 1 :] if frame.gps]
    last = [frame.gps for frame in WELL[: ASKED_AT + 1] if frame.gps][-1]
    assert len(stuck) == sum(frame.gps is not None for frame in WELL[ASKED_AT + 1 :])
    assert all(replace(fix, time_us=last.time_us) == last and fix.time_us > last.time_us for fix in stuck)


def states(*faults: Fault, frames: int = 150) -> list[World]:
    flown, worlds = plant(Feedback.STATE), []
    for number in range(frames):
        worlds.append(flown.world)
        flown.answer(COMMAND, faults if number == ASKED_AT else ())
    return worlds


def test_a_lost_rotor_runs_down_and_the_others_go_on() -> None:
    well, ill = states(), states(Fault(MOTOR, OFF, 2))
    assert ill[: ASKED_AT + 1] == well[: ASKED_AT + 1]
    speeds = ill[-1].rotor_speeds
    assert speeds[1] < 0.05 * VEHICLE.hover_speed
    assert [speeds[rotor] for rotor in (0, 2, 3)] == pytest.approx([VEHICLE.hover_speed] * 3, rel=0.01)


def test_a_weak_rotor_turns_as_fast_and_lifts_less() -> None:
    part = 0.65
    well, weak = states()[ASKED_AT + 1], states(Fault(MOTOR, WRONG, 1, (part, 0.0, 0.0, 0.0)))[ASKED_AT + 1]
    assert weak.rotor_speeds == pytest.approx(well.rotor_speeds, rel=1e-3)
    lost_m_s2 = (1.0 - part) * VEHICLE.gravity_m_s2 / 4.0
    assert weak.state[2] - well.state[2] == pytest.approx(-lost_m_s2 * FRAME_US * 1e-6, rel=0.02)


def test_a_stuck_rotor_obeys_nothing_not_even_disarming() -> None:
    flown = plant(Feedback.STATE)
    for _ in range(10):
        flown.answer(COMMAND)
    speed = flown.world.rotor_speeds[2]
    flown.inject([Fault(MOTOR, STUCK, 3)])
    for _ in range(100):
        flown.answer(ActuatorCommand(0, (0.0, 0.0, 0.0, 0.0), armed=False))
    assert flown.world.rotor_speeds[2] == pytest.approx(speed)
    assert max(flown.world.rotor_speeds[rotor] for rotor in (0, 1, 3)) < 0.01 * speed
    flown.inject([Fault(MOTOR, OK)])
    flown.answer(COMMAND)
    assert flown.world.rotor_speeds[2] < speed or flown.world.rotor_speeds[0] > 0.01 * speed


def test_rotors_that_are_well_again_fly_as_before() -> None:
    well, again = states(), states(Fault(MOTOR, WRONG), Fault(MOTOR, STUCK, 2), Fault(MOTOR, OK))
    assert again[-1].state == well[-1].state
    assert again[-1].charge_used_ah == well[-1].charge_used_ah


def test_a_battery_sags_and_gets_back_what_was_taken() -> None:
    assert VEHICLE.battery is not None
    capacity_ah = VEHICLE.battery.capacity_ah
    well = states()[-1]
    sagging = states(Fault(BATTERY, WRONG, 0, (0.2, 0.0, 0.0, 0.0)))[-1]
    assert sagging.charge_used_ah == pytest.approx(0.8 * capacity_ah, rel=0.01)
    assert sagging.voltage_v < well.voltage_v - 0.5 * (VEHICLE.battery.full_voltage_v - VEHICLE.battery.empty_voltage_v)
    back = states(Fault(BATTERY, OFF), Fault(BATTERY, OK))[-1]
    assert back.charge_used_ah == pytest.approx(well.charge_used_ah, rel=1e-9)
    assert back.voltage_v == pytest.approx(well.voltage_v)
    resisting = states(Fault(BATTERY, WRONG, 0, (1.0, 3.0, 0.0, 0.0)))[-1]
    assert resisting.voltage_v < well.voltage_v
    assert 1.0 < resisting.charge_used_ah / well.charge_used_ah < 1.1  # as much power at less voltage


def test_the_next_frame_tells_what_became_of_it() -> None:
    flown = plant(Feedback.STATE)
    assert flown.measure()[1].results == ()
    asked = (Fault(MOTOR, OFF, 1), Fault(GPS, OFF), Fault(MOTOR, WRONG, 0, (9.0, nan, nan, nan)))
    flown.answer(COMMAND, asked)
    results = (RESULT_ACCEPTED, RESULT_UNSUPPORTED, RESULT_DENIED)
    assert flown.measure()[1].results == tuple(
        FaultResult(fault.unit, fault.kind, result) for fault, result in zip(asked, results, strict=True)
    )
    flown.answer(COMMAND)
    assert flown.measure()[1].results == ()


def test_it_tells_the_battery_of_its_world() -> None:
    flown = plant(Feedback.STATE)
    for _ in range(100):
        flown.answer(COMMAND)
    battery = flown.measure()[1].battery
    assert battery is not None
    assert VEHICLE.battery is not None
    assert battery.voltage_v == flown.world.voltage_v
    assert battery.used_ah == flown.world.charge_used_ah
    before = flown.world.charge_used_ah
    flown.answer(COMMAND)
    used_a = (flown.world.charge_used_ah - before) * 3600.0 / (FRAME_US * 1e-6)
    assert battery.current_a == pytest.approx(used_a, rel=1e-3)
    bare = VEHICLE.without(["battery"])
    assert Physics(bare, "rk4").battery(flown.world) is NO_BATTERY
