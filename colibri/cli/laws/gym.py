"""`colibri gym`."""

from argparse import ArgumentTypeError, Namespace
from pathlib import Path
from typing import Any

import msgspec

from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import loading


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    parser.add_argument("action", choices=["export"], help="write POLICY.toml beside a policy")
    add("policy", "POLICY.onnx", "a model from observations, (1, n), to actions, (1, a)", type=Path)
    add("--env", "NAME", "where it has learned", default="colibri/Hover-v0")
    parser.several("--set", "KEY=VALUE", "a keyword of the environment", type=_keyword)


def run(args: Namespace) -> int:
    with loading():
        import gymnasium

        from colibri.gym import GymError, export_policy

    try:
        env = gymnasium.make(args.env, disable_env_checker=True, **dict(args.set))
    except gymnasium.error.Error as error:
        raise GymError(f"--env: {error}") from None
    print(export_policy(args.policy, env))
    return 0


def _keyword(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise ArgumentTypeError(f'must be KEY=VALUE, "action=rates" say, not "{text}"')
    try:
        return name, msgspec.json.decode(value)
    except msgspec.DecodeError:
        return name, value
