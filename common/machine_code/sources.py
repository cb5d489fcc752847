"""Source files of a kernel's machine code, and their hashes."""

from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from types import FunctionType
from typing import Any


def files_of(function: Callable[..., Any]) -> set[str]:
    """Return the files of a function and of the functions it calls by global name."""
    files: set[str] = set()
    seen: set[Any] = set()
    waiting: list[Any] = [function]
    while waiting:
        it = waiting.pop()
        it = getattr(it, "py_func", it)
        if not isinstance(it, FunctionType) or it in seen:
            continue
        seen.add(it)
        files.add(it.__code__.co_filename)
        waiting += [it.__globals__.get(name) for name in it.__code__.co_names]
    return files


@cache
def hash_of(file: str) -> str:
    """Return the hash of a file at the first call."""
    return sha256(Path(file).read_bytes()).hexdigest()
