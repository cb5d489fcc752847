"""`companion.toml`, an identified response."""

from pathlib import Path
from typing import Annotated, TypeAlias

import msgspec

from colibri.common.config import UNREADABLE, NotNegative, Positive, Table
from colibri.common.files import read_text
from colibri.companion.errors import CompanionError
from colibri.companion.stack import Response

TimeConstant: TypeAlias = Annotated[float, msgspec.Meta(ge=0.005, le=1.0)]
Scale: TypeAlias = Annotated[float, msgspec.Meta(ge=0.5, le=1.8)]
Lag: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0, le=0.5)]
Latency: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0, le=0.2)]


class ResponseFile(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    time_constant_s: tuple[TimeConstant, TimeConstant, TimeConstant]
    latency_s: Latency
    thrust_lag_s: NotNegative
    max_rate_rad_s: tuple[Positive, Positive, Positive]
    max_acceleration_rad_s2: tuple[Positive, Positive, Positive]
    acceleration_lag_s: tuple[Lag, Lag, Lag] = (0.0, 0.0, 0.0)
    thrust_scale: Scale = 1.0
    """Actual thrust over the thrust derived from the vehicle's parameters."""


def read_response(path: Path) -> tuple[Response, float]:
    try:
        text = read_text(path)
        found = msgspec.toml.decode(text, type=ResponseFile)
    except (OSError, UnicodeDecodeError) as error:
        raise CompanionError(f"{path}: {getattr(error, 'strerror', error)}") from error
    except UNREADABLE as error:
        raise CompanionError(f"{path}: {error}") from error
    response = Response(*(getattr(found, name) for name in Response._fields))
    return response, found.thrust_scale


def response_text(response: Response, thrust_scale: float, remarks: list[str]) -> str:
    lines = [f"# {remark}" for remark in remarks]
    for name, value in (response._asdict() | {"thrust_scale": thrust_scale}).items():
        values = [f"{part:.4g}" for part in value] if isinstance(value, tuple) else None
        lines.append(f"{name} = [{', '.join(values)}]" if values else f"{name} = {float(value):.4g}")
    return "\n".join(lines) + "\n"
