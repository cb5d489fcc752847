"""The condensed QP against what it stands for, evaluated step by step."""

import numpy as np
import pytest

from colibri.autopilot.control.lpv_mpc import condensing, prediction
from colibri.autopilot.control.lpv_mpc.prediction import ANGLES, INPUTS, RATES, STATES

STEPS, STARTS = 12, np.array([0, 1, 3, 7])
MOVED = INPUTS * len(STARTS)
N = MOVED + condensing.SLACKS
FROM_THRUST = np.full(4, 0.05)
FROM_MOMENTS = np.array([[0.0, -0.6, -1.5], [-0.6, 0.0, 1.5], [0.0, 0.6, -1.5], [0.6, 0.0, 1.5]])
MIN_SQUARED, MAX_SQUARED = 0.01, 1.0
LIMITS = np.array([1.0, 1.1, 6.0, 7.0, 3.0])
PROBLEM = condensing.Problem(
    starts=STARTS,
    checked=np.array([3, 6, 12]),
    output_weight=np.ones(3),
    increment_weight=np.ones(3),
    terminal_weight=np.eye(STATES + INPUTS),
    max_increment=np.ones(3),
    limits=LIMITS,
    from_thrust=FROM_THRUST,
    from_moments=FROM_MOMENTS,
    min_squared=MIN_SQUARED,
)


@pytest.fixture(params=range(4))
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    return np.random.default_rng(request.param)


def responses_of(rng: np.random.Generator, u: np.ndarray) -> np.ndarray:
    x = rng.normal(size=STATES) * [0.4, 2, 0.4, 2, 1, 1, 0.05, 0.05, 0.01]
    responses = np.empty((STEPS + 1, STATES, 1 + MOVED))
    body = prediction.Body(0.0034, 0.0034, 0.006, 40.0)
    schedule = np.tile(x[list(prediction.SCHEDULE)], (STEPS, 1))
    now = prediction.InitialState(x, u, np.zeros(3), 1e-4, 1.0)
    prediction.respond(now, schedule, body, STARTS, 0.008, responses)
    return responses


def moments_of(u: np.ndarray, z: np.ndarray) -> np.ndarray:
    moves = u + z[:MOVED].reshape(-1, INPUTS).cumsum(axis=0)
    held: np.ndarray = moves[[np.searchsorted(STARTS, step, side="right") - 1 for step in range(STEPS)]]
    return held


def test_the_cost_is_the_sum_over_the_horizon(rng: np.random.Generator) -> None:
    u = rng.normal(size=3) * 0.05
    responses = responses_of(rng, u)
    Q, R = rng.uniform(0.1, 2.0, 3), rng.uniform(0.1, 2.0, 3)
    root = rng.normal(size=(STATES + INPUTS, STATES + INPUTS))
    S = root @ root.T
    angles, terminal = rng.normal(size=(STEPS, 3)), rng.normal(size=STATES + INPUTS)
    H, f = np.zeros((N, N)), np.zeros(N)
    problem = PROBLEM._replace(output_weight=Q, increment_weight=R, terminal_weight=S)
    condensing.quadratic_cost(responses, condensing.Target(angles, terminal, np.zeros(STEPS)), u, problem, H, f)

    def cost(z: np.ndarray) -> float:
        states = responses @ [1.0, *z[:MOVED]]
        errors = states[1:, list(ANGLES)] - angles
        end = np.concatenate([states[-1], moments_of(u, z)[-1]]) - terminal
        increments = z[:MOVED].reshape(-1, INPUTS)
        return 0.5 * float((Q * errors**2).sum() + end @ S @ end + (R * increments**2).sum())

    nothing = np.zeros(N)
    for _ in range(5):
        z = np.concatenate([rng.normal(size=MOVED) * 0.1, np.zeros(condensing.SLACKS)])
        assert 0.5 * z @ H @ z + f @ z == pytest.approx(cost(z) - cost(nothing), rel=1e-9)
    assert (H == H.T).all()


def test_rotor_rows_hold_iff_rotors_are_within_limits(rng: np.random.Generator) -> None:
    u = rng.normal(size=3) * 0.05
    thrust = rng.uniform(4.0, 12.0, STEPS)
    rows = 2 * condensing.ROTORS * len(STARTS)
    G, h = np.zeros((rows, N)), np.zeros(rows)
    count = condensing.limit_rotors(PROBLEM, thrust, u, MAX_SQUARED, G, h)
    assert count == rows
    verdicts = set()
    for size in (0.02, 0.1, 0.3, 0.6):
        for _ in range(20):
            z = rng.normal(size=N) * size
            squared = thrust[:, None] * FROM_THRUST + moments_of(u, z) @ FROM_MOMENTS.T
            within = bool(((squared >= MIN_SQUARED) & (squared <= MAX_SQUARED)).all())
            assert bool((G @ z <= h).all()) is within
            verdicts.add(within)
    assert verdicts == {True, False}


def tilt_of(phi: float, theta: float) -> float:
    return float(np.arccos(np.cos(phi) * np.cos(theta)))


def test_motion_rows_hold_iff_slacks_cover_the_excess(rng: np.random.Generator) -> None:
    u = rng.normal(size=3) * 0.05
    responses = responses_of(rng, u)
    schedule = np.zeros((STEPS, len(prediction.SCHEDULE)))  # without a tilt: no tangent
    rows = condensing.MOTION_ROWS * len(PROBLEM.checked)
    G, h = np.zeros((rows + 3, N)), np.zeros(rows + 3)
    assert condensing.limit_motion(responses, schedule, PROBLEM, 3, G, h) == rows + 3
    verdicts = set()
    for slacks in ([0.0, 0.0], [5.0, 0.0], [0.0, 5.0], [0.3, 0.3], [5.0, 5.0]):
        for size in np.geomspace(0.01, 0.5, 20):
            z = np.concatenate([rng.normal(size=MOVED) * size, slacks])
            states = (responses @ [1.0, *z[:MOVED]])[PROBLEM.checked]
            exceeded = np.abs(states[:, [*ANGLES[:2], *RATES]]) / LIMITS - 1.0
            within = exceeded[:, :2].max() <= slacks[0] and exceeded[:, 2:].max() <= slacks[1]
            assert bool((G[3:] @ z <= h[3:]).all()) is bool(within)
            verdicts.add(bool(within))
    assert verdicts == {True, False}


@pytest.mark.parametrize("max_tilt", [0.3, 1.0, 1.3])
def test_no_tilt_within_the_limit_is_beyond_any_tangent_to_it(rng: np.random.Generator, max_tilt: float) -> None:
    normal = np.empty(2)
    for phi, theta in rng.uniform(-1.4, 1.4, (50, 2)):
        distance = condensing.tilt_tangent(phi, theta, max_tilt, normal)
        assert normal @ [phi, theta] > 0.0
        others = rng.uniform(-1.5, 1.5, (200, 2))
        within = np.array([tilt_of(*other) <= max_tilt for other in others])
        assert (others[within] @ normal <= distance).all()
        x, y = np.sin(theta) * np.cos(phi), np.sin(phi)  # the same direction at the limit: it touches
        x, y = np.sin(max_tilt) * np.array((x, y)) / np.hypot(x, y)
        touched = (np.arcsin(y), np.arctan2(x, np.cos(max_tilt)))
        assert tilt_of(*touched) == pytest.approx(max_tilt)
        assert normal @ touched == pytest.approx(distance)
