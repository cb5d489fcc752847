"""Policies as control laws: exported, flown, refused."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import colibri
from colibri.autopilot.control.policy import OnnxFile
from colibri.cli.main import main
from colibri.gym import QuadrotorEnv, export_policy
from colibri.plant.vehicle.description import load_vehicle
from tests.support.refusals import refusal_of

_GRAVITY_M_S2 = 9.81


@cache
def _linear(actions: int = 4) -> list[tuple[Any, Any]]:
    """Return one layer that hovers with body rates: observation to thrust, p, q, r."""
    vehicle = load_vehicle("hummingbird")
    per_m_s2 = 2.0 * vehicle.body.mass_kg / vehicle.max_wrench()[0]
    weights = np.zeros((actions, 22))
    weights[0, [2, 5]] = -4.0 * per_m_s2, -4.0 * per_m_s2
    weights[1, [1, 4]] = 4.0 / _GRAVITY_M_S2 / 8.0
    weights[2, [0, 3]] = -4.0 / _GRAVITY_M_S2 / 8.0
    weights[1, 11], weights[2, 8] = 1.0, -1.0
    return [(weights, np.array([np.arctanh(per_m_s2 * vehicle.gravity_m_s2 - 1.0), 0.0, 0.0, 0.0])[:actions])]


class Linear(colibri.PolicyLaw):
    inputs = colibri.PolicyInputs(action="rates", interval_ms=4)

    def act(self, observation: Any) -> Any:
        ((weights, offsets),) = _linear()
        return np.tanh(weights @ observation + offsets)


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("policy") / "policy.onnx"
    export_policy(path, QuadrotorEnv(action="rates"), _linear())
    return path


def test_an_exported_policy_flies_as_in_its_environment(policy: Path) -> None:
    start = {"x": 0.3, "y": -0.2}
    options: dict[str, Any] = {"duration": 2, "link": "direct", "start": {**start, "z": 2.0, "rotors": 4320.0}}
    flight, again = (colibri.fly("hover", controller=law, **options) for law in (str(policy), Linear))
    assert flight.lost is None
    assert np.abs(np.array(flight.samples["x"]) - again.samples["x"]).max() < 1e-4
    still = dict.fromkeys(("z", "vx", "vy", "vz", "p", "q", "r", "phi", "theta"), 0.0)
    env = QuadrotorEnv(action="rates", draw={f"start.{key}": value for key, value in {**still, **start}.items()})
    seen, _ = env.reset(seed=0)
    law = Linear({}, load_vehicle("hummingbird"), lambda: 0.0)
    for _ in range(500):
        seen, *_ = env.step(law.act(seen).astype(np.float32))
    flown = [flight.samples[axis][-1] for axis in "xy"]
    assert np.abs(flown - seen[:2]).max() < 2e-3
    assert np.abs(flown).max() < 0.15


def test_a_policy_flies_alike_at_any_heading() -> None:
    distances = []
    for yaw in (0.0, 130.0):
        ahead = 0.3 * np.exp(1j * np.radians(yaw))
        start = {"x": ahead.real, "y": ahead.imag, "z": 2.0, "psi": yaw, "rotors": 4320.0}
        flight = colibri.fly(f"hover:yaw={yaw}", controller=Linear, duration=2, link="direct", start=start)
        distances.append(np.hypot(*(np.array(flight.samples[axis]) for axis in "xy")))
    assert np.abs(distances[1] - distances[0]).max() < 1e-6
    assert distances[0][-1] < 0.15 < distances[0][0]


def test_a_policy_meets_the_requirements_on_laws() -> None:
    assert colibri.check_controller(Linear, only=["interface", "memory"]).passed


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"action": "velocity"}, "action velocity is a setpoint"),
        ({"gates": [(0, 0, 2), (1, 0, 2)], "action": "rates"}, "gates are no reference"),
        ({"rate": 300.0, "action": "rates"}, "rate must be whole milliseconds"),
        ({"history": 2, "action": "rates"}, "the model has 22 observations, its TOML file 26"),
    ],
)
def test_an_unsuitable_environment_is_refused(options: dict[str, Any], message: str, policy: Path) -> None:
    assert message in refusal_of(export_policy, policy, QuadrotorEnv(**options))


@pytest.mark.parametrize(
    ("name", "content", "table", "message"),
    [
        ("no.onnx", None, None, "No such file"),
        ("bare.onnx", b"", None, "bare.toml is missing: write it with colibri gym export"),
        ("text.onnx", b"text", 'action = "rates"\ninterval_ms = 4', "is not a policy"),
        ("typo.onnx", b"text", 'action = "rate"\ninterval_ms = 4', "typo.toml"),
    ],
)
def test_unusable_files_get_one_line(
    name: str, content: bytes | None, table: str | None, message: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    if table is not None:
        path.with_suffix(".toml").write_text(table)
    assert message in refusal_of(lambda: OnnxFile.read(str(path))({}, load_vehicle("hummingbird"), lambda: 0.0))


def test_the_command_exports_a_policy(policy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    export = ["gym", "export", str(policy), "--env", "colibri/Track-v0", "--set"]
    assert main([*export, "action=rates"]) == 0
    assert capsys.readouterr().out.strip() == str(policy.with_suffix(".toml"))
    for wrong, message in (
        ("action=rate", "unknown action"),
        ("preview=1", "the model has 22 observations"),
        ("rates", "KEY=VALUE"),
    ):
        with pytest.raises(SystemExit):
            main([*export, wrong])
        assert message in capsys.readouterr().err
