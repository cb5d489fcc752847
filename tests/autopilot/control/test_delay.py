"""Delay compensation: what it predicts is what the vehicle then does, and which delay it takes for true."""

from collections.abc import Sequence

from colibri.autopilot.control.delay import MAX_DELAY_US, DelayCompensation
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
from colibri.plant.environment.weather import Weather, Wind
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, starting_world, state_frame
from colibri.plant.simulation.plant import Plant
from colibri.plant.vehicle.description import load_vehicle

VEHICLE = load_vehicle("hummingbird")
FRAME_US = 4_000
DELAY_US = 22_000
HOVER = VEHICLE.hover_speed / VEHICLE.rotors.max_speed
STILL = (0.0, 0.0, 0.0, 0.0)


def flown(delay: DelayCompensation, samples: int, weather: Weather | None = None) -> list[float]:
    """Fly in the dark with commands that act late; return how far off the velocity was that was predicted, m/s."""
    start = Start(z=20.0, vx=3.0, rotors=VEHICLE.hover_speed * 60.0 / 6.283185307179586)
    physics = Physics(VEHICLE, "rk4", weather) if weather else Physics(VEHICLE, "rk4")
    world = starting_world(start, VEHICLE, weather) if weather else starting_world(start, VEHICLE)
    plant = Plant(
        world, VEHICLE, physics, Feedback.STATE, DEFAULT_ORIGIN, seed=0, interval_us=2_000, latency_us=DELAY_US // 2
    )
    delay.begin((HOVER,) * 4)
    predicted: dict[int, StateFrame] = {}
    errors = []
    for sample in range(4 * samples):
        world = plant.world
        frame = state_frame(world)
        if world.time_us in predicted:
            errors.append(furthest(predicted.pop(world.time_us).velocity_enu_m_s, frame.velocity_enu_m_s))
        if sample % 4 == 0:
            ahead = delay.ahead(frame, world.charge_used_ah)
            predicted[ahead.time_us] = ahead
        a, b = 0.02 * (-1) ** (sample // 20), 0.01 * (-1) ** (sample // 12)
        command = ActuatorCommand(world.time_us, (HOVER + a, HOVER + b, HOVER - a, HOVER - b), armed=True)
        delay.sent(command)
        plant.answer(command)
    return errors


def furthest(a: Sequence[float], b: Sequence[float]) -> float:
    return max(abs(x - y) for x, y in zip(a, b, strict=True))


def test_what_is_predicted_comes_to_pass() -> None:
    errors = flown(DelayCompensation(VEHICLE, DELAY_US * 1e-6), 30)
    assert len(errors) > 25
    assert max(errors) < 1e-6


def test_wind_is_observed_and_carried_along() -> None:
    errors = flown(DelayCompensation(VEHICLE, DELAY_US * 1e-6), 60, Weather(Wind(5.0, 270.0)))
    assert errors[0] > 5e-3
    assert max(errors[-10:]) < 0.1 * errors[0]


def test_without_a_delay_the_frame_is_the_state() -> None:
    frame = StateFrame(0, (0.0, 0.0, 1.0), STILL[:3], (1.0, 0.0, 0.0, 0.0), STILL[:3])
    assert DelayCompensation(VEHICLE).ahead(frame, 0.0) is frame


def test_it_stays_on_the_ground_until_its_rotors_carry_it() -> None:
    delay = DelayCompensation(VEHICLE, 0.016)
    delay.begin(STILL, rests=True)
    frames = [StateFrame(8_000 * n, STILL[:3], STILL[:3], (1.0, 0.0, 0.0, 0.0), STILL[:3]) for n in range(12)]
    for frame in frames:
        ahead = delay.ahead(frame, 0.0)
        if frame.time_us < 32_000:
            assert ahead is frame
        delay.sent(ActuatorCommand(frame.time_us, (0.9,) * 4, armed=True))
    assert ahead.velocity_enu_m_s[2] > 0.0


def test_the_measured_delay_is_a_steady_median() -> None:
    delay = DelayCompensation(VEHICLE)
    for delay_us in (20_000, 20_300, 90_000, 19_800, 20_600, 150_000, 20_400):
        delay.measure(delay_us)
        assert delay.delay_us == 20_000
    for _ in range(25):
        delay.measure(24_000)
    assert delay.delay_us == 24_000
    for _ in range(25):
        delay.measure(10**7)
    assert delay.delay_us == MAX_DELAY_US


def test_the_delay_that_is_told_counts_until_it_is_taken_back() -> None:
    delay = DelayCompensation(VEHICLE, 0.03)
    delay.measure(12_000)
    assert delay.delay_us == 30_000
    delay.declare(None)
    assert delay.delay_us == 12_000
    delay.declare(0.0)
    assert delay.delay_us == 0
