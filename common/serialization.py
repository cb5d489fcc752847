"""Plain data ⇄ bytes: named tuples of numbers, texts and arrays of floats, as they are kept over a restart."""

from typing import Any, TypeVar

import msgspec
import numpy as np

Data = TypeVar("Data")
_FLOAT64 = np.dtype(np.float64)


def to_bytes(data: Any) -> bytes:
    """Return the bytes of plain data.

    Raises:
        TypeError: It holds something else.
    """
    return _ENCODER.encode(data)


def of_bytes(kind: type[Data], content: bytes) -> Data | None:
    """Return the data of type `kind` that `to_bytes` made `content` of; None where that cannot be."""
    try:
        return msgspec.msgpack.decode(content, type=kind, dec_hook=_decoded)
    except (msgspec.DecodeError, TypeError, ValueError):
        return None


def _encoded(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype == _FLOAT64:
        return value.shape, value.tobytes()
    raise TypeError(f"{type(value)} is not plain")


def _decoded(kind: Any, value: Any) -> Any:
    """Return an array: nothing else of what is kept is not known to msgspec.

    Raises:
        ValueError: Its bytes are not of its shape.
    """
    del kind
    shape, content = value
    return np.frombuffer(content, dtype=np.float64).reshape(shape).copy()


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_encoded)
