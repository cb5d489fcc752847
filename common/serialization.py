"""Plain data ⇄ bytes: named tuples and records of numbers, texts and float arrays."""

from typing import Any, TypeVar

import msgspec
import numpy as np

Data = TypeVar("Data")
_FLOAT64 = np.dtype(np.float64)


def to_bytes(data: Any) -> bytes:
    return _ENCODER.encode(data)


def of_bytes(kind: type[Data], content: bytes) -> Data | None:
    """Decode `to_bytes`; `None` if the content is invalid."""
    try:
        return msgspec.msgpack.decode(content, type=kind, dec_hook=_decoded)
    except (msgspec.DecodeError, TypeError, ValueError, RecursionError):
        return None


def _encoded(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype == _FLOAT64:
        return value.shape, value.tobytes()
    raise TypeError(f"{type(value)} is not plain")


def _decoded(_kind: Any, value: Any) -> Any:
    shape, content = value
    return np.frombuffer(content, dtype=np.float64).reshape(shape).copy()


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_encoded)
