"""Errors as users read them."""

from argparse import ArgumentTypeError
from collections.abc import Callable
from typing import Any

import pytest

from colibri.common.errors import Error


def refusal_of(call: Callable[..., Any], *args: Any, **options: Any) -> str:
    """Return the message of the error that a call raises, which is one line."""
    with pytest.raises((Error, ArgumentTypeError)) as refused:
        call(*args, **options)
    message = str(refused.value)
    assert "\n" not in message
    return message
