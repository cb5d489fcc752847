"""Snapshots of running objects: their state is copied, and written back into the same objects.

A snapshot follows every reference from its roots, and keeps a shallow copy of each mutable object. Immutable objects
are shared; files, sockets and the state of modules and classes are left out. As objects stay the same, references to
them stay valid, as in a callback.
"""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import is_dataclass
from enum import Enum
from gc import get_referents
from operator import attrgetter, itemgetter
from random import Random
from types import BuiltinMethodType, CellType, FunctionType, MappingProxyType, MethodType, ModuleType
from typing import Any, TypeAlias

import msgspec
import numpy as np

from colibri.common.errors import Error


class SnapshotError(Error):
    """An object's state cannot be kept."""


Restore: TypeAlias = Callable[[], object]
Kept: TypeAlias = tuple[Restore | None, Iterable[Any]]
"""A function that restores an object, `None` if it cannot change; and its references."""
Keep: TypeAlias = Callable[[Any], Kept]


class ObjectSnapshot:
    def __init__(self, roots: Iterable[object]) -> None:
        restores: list[Restore] = []
        seen: dict[int, Any] = {}
        todo: list[Any] = [*roots]
        while todo:
            each = todo.pop()
            cls = type(each)
            keep = _KINDS.get(cls)
            if keep is None:
                keep = _KINDS[cls] = _kind(cls)
            if keep is _share or id(each) in seen:
                continue
            seen[id(each)] = each
            restore, referents = keep(each)
            if restore is not None:
                restores.append(restore)
            todo.extend(referents)
        self._restores, self._seen = restores, seen  # all that was seen lives on: its numbers are not given away again

    def restore(self) -> None:
        for restore in self._restores:
            restore()


def _share(_each: Any) -> Kept:
    return None, ()


def _follow(each: Any) -> Kept:
    return None, get_referents(each)


def _container(each: Any) -> Kept:
    kept = each.copy()
    refill = each.update if hasattr(each, "update") else each.extend

    def restore() -> None:
        each.clear()
        refill(kept)

    return restore, get_referents(each)


def _array(each: Any) -> Kept:
    objects = each.ravel().tolist() if each.dtype.hasobject else ()
    if not each.flags.writeable:
        return None, (each.base, *objects)
    kept = each.copy()
    return lambda: np.copyto(each, kept), (each.base, *objects)


def _generator(each: np.random.Generator) -> Kept:
    kept = each.bit_generator.state
    return lambda: setattr(each.bit_generator, "state", kept), ()


def _random(each: Random) -> Kept:
    kept = each.getstate()
    return lambda: each.setstate(kept), ()


def _cell(each: CellType) -> Kept:
    try:
        kept = each.cell_contents
    except ValueError:  # nothing is bound to the name yet
        return None, ()
    return lambda: setattr(each, "cell_contents", kept), (kept,)


def _function(each: FunctionType) -> Kept:
    named = each.__kwdefaults__ or {}
    return None, (*(each.__closure__ or ()), *(each.__defaults__ or ()), *named.values())


def _attributes(each: Any) -> Kept:
    attributes = vars(each)
    kept = attributes.copy()

    def restore() -> None:
        for name, value in kept.items():
            if attributes.get(name, kept) is not value:
                attributes[name] = value
        for name in attributes.keys() - kept.keys():
            del attributes[name]

    return restore, kept.values()


def _slots(names: list[str]) -> Keep:
    def keep(each: Any) -> Kept:
        kept = [(name, getattr(each, name)) for name in names if hasattr(each, name)]

        def restore() -> None:
            for name, value in kept:
                setattr(each, name, value)

        return restore, [value for _, value in kept]

    return keep


def _all(keeps: list[Keep]) -> Keep:
    def keep(each: Any) -> Kept:
        parts = [part(each) for part in keeps]
        restores = [restore for restore, _ in parts if restore is not None]

        def restore_all() -> None:
            for restore in restores:
                restore()

        return restore_all, [referent for _, referents in parts for referent in referents]

    return keep


_SHARED = (int, float, complex, str, bytes, type(None), type, Enum, ModuleType, range, slice, itemgetter, attrgetter)
_FOLLOWED = (tuple, frozenset, MethodType, BuiltinMethodType)
_CHANGING: tuple[tuple[Any, Keep], ...] = (
    ((list, bytearray, dict, set, deque), _container),
    (np.ndarray, _array),
    (np.random.Generator, _generator),
    (Random, _random),
    (CellType, _cell),
    (FunctionType, _function),
)
_STATELESS_PACKAGES = (
    *("numba", "_nrt_python", "onnxruntime", "llvmlite", "msgspec", "re"),
    *("_struct", "ctypes", "_ctypes", "weakref", "numpy", "_thread"),
)
_HEAP_TYPE = 1 << 9  # flag of a class written in Python
_KINDS: dict[type, Keep] = {}


def _kind(cls: type) -> Keep:
    if issubclass(cls, _SHARED) or cls is object:
        return _share
    if issubclass(cls, _FOLLOWED) or (cls.__module__ == "functools" and cls.__name__ == "partial"):
        return _follow
    if issubclass(cls, msgspec.Struct):
        return _follow if cls.__struct_config__.frozen else _slots(list(cls.__struct_fields__))
    frozen = is_dataclass(cls) and cls.__dataclass_params__.frozen  # type: ignore[attr-defined]
    if frozen or issubclass(cls, np.void):  # a record within an array
        return _follow
    keeps = [keep for base, keep in _CHANGING if issubclass(cls, base)]
    is_stateless = cls.__module__.partition(".")[0] in _STATELESS_PACKAGES
    if cls.__flags__ & _HEAP_TYPE and not is_stateless:
        names = [name for base in cls.__mro__ for name in _slot_names(base)]
        if names:
            keeps.append(_slots(names))
        if cls.__dictoffset__:
            keeps.append(_attributes)
        return keeps[0] if len(keeps) == 1 else _all(keeps)
    if keeps:
        return keeps[0]
    if cls is MappingProxyType:
        return _follow
    if is_stateless or cls.__name__ == "_lru_cache_wrapper":
        return _share
    raise SnapshotError(f"the state of a {cls.__module__}.{cls.__qualname__} cannot be kept")


def _slot_names(base: type) -> list[str]:
    slots = vars(base).get("__slots__", ())
    names = [slots] if isinstance(slots, str) else list(slots)
    return [name for name in names if name not in ("__dict__", "__weakref__")]
