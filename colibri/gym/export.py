"""Policies as control laws: an ONNX model, and a TOML file of its inputs and outputs."""

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import msgspec
import numpy as np
from numpy.typing import ArrayLike

from colibri.autopilot.control.policy import OnnxFile, OnnxLaw, PolicyInputs
from colibri.common.errors import shown
from colibri.gym.arguments import GymError
from colibri.gym.episodes import PILOTED, Episodes

_HEAD = "# Inputs and outputs of {}, as in docs/gym.md."
Layers = Sequence[tuple[ArrayLike, ArrayLike]]
"""Weights, (outputs, inputs), and offsets, (outputs,), of each layer, with tanh between two and after the last."""


def export_policy(path: str | Path, env: Any, layers: Layers | None = None) -> Path:
    """Write the TOML file of a policy, and with `layers` its ONNX file, too; return the path of the TOML file.

    Args:
        path: FILE.onnx.
        env: The environment in which the policy has learned, or a vector of them.

    Raises:
        GymError, PolicyError: A control law cannot have its observations or actions, or the model does not fit them.
    """
    path, episodes = Path(path), getattr(env.unwrapped, "episodes", None)
    if path.suffix != ".onnx":
        raise GymError(f'a policy must be a file .onnx, not "{shown(path)}"')
    if not isinstance(episodes, Episodes):
        raise GymError(f'env must be an environment of colibri.gym, not "{shown(env)}"')
    inputs = _inputs(episodes)
    if layers is not None:
        path.write_bytes(_model(layers))
    table = path.with_suffix(".toml")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise GymError(f"{path}: {error.strerror}") from error
    law = OnnxLaw(OnnxFile(str(path), content, inputs), {}, episodes.vehicle, lambda: 0.0)
    law.act(np.zeros(episodes.observations.shape[1], dtype=np.float32))
    lines = [f"{key} = {msgspec.json.encode(value).decode()}" for key, value in msgspec.structs.asdict(inputs).items()]
    table.write_text("\n".join([_HEAD.format(path.name), *lines, ""]), encoding="utf-8")
    return table


def gym(args: Namespace) -> int:
    try:
        env = gymnasium.make(args.env, disable_env_checker=True, **dict(args.set))
    except gymnasium.error.Error as error:
        raise GymError(f"--env: {error}") from None
    print(export_policy(args.policy, env))  # noqa: T201
    return 0


def _inputs(episodes: Episodes) -> PolicyInputs:
    ms, preview_ms = 1e3 * episodes.interval_s, 1e3 * episodes.preview_s
    if episodes.action in PILOTED:
        raise GymError(f"action {episodes.action} is a setpoint: a control law needs an action rotors or rates")
    if episodes.gate_m:
        raise GymError("gates are no reference of a control law: export policies of tracks")
    for name, value in (("rate", ms), ("preview_s", preview_ms)):
        if abs(value - round(value)) > 1e-9:
            raise GymError(f"{name} must be whole milliseconds in flight, not {value:g} ms")
    p, q, r = episodes.max_rates
    kind: Any = episodes.action
    preview, history = episodes.preview, episodes.history
    times = {"interval_ms": round(ms), "preview_ms": round(preview_ms)}
    return PolicyInputs(action=kind, preview=preview, history=history, max_rates_rad_s=(p, q, r), **times)


def _model(layers: Layers) -> bytes:
    try:
        from onnx import TensorProto, checker, helper, numpy_helper
    except ModuleNotFoundError as error:
        raise GymError("policies are written by onnx: pip install 'colibri-sitl[onnx]'") from error
    nodes, constants, last = [], [], "observation"
    for n, (weights, offsets) in enumerate(layers):
        pair = {f"w{n}": np.asarray(weights, dtype=np.float32), f"b{n}": np.asarray(offsets, dtype=np.float32)}
        constants += [numpy_helper.from_array(values, name) for name, values in pair.items()]
        end = "action" if n == len(layers) - 1 else f"h{n}"
        nodes.append(helper.make_node("Gemm", [last, *pair], [f"s{n}"], transB=1))
        nodes.append(helper.make_node("Tanh", [f"s{n}"], [end]))
        last = end
    sizes = {"observation": np.shape(layers[0][0])[1], "action": np.shape(layers[-1][0])[0]}
    given, taken = (helper.make_tensor_value_info(it, TensorProto.FLOAT, [1, n]) for it, n in sizes.items())
    graph = helper.make_graph(nodes, "policy", [given], [taken], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    checker.check_model(model)
    whole: bytes = model.SerializeToString()
    return whole
