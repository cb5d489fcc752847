"""Parameter files in QGroundControl's text format."""

from colibri.mavlink.errors import MavlinkError
from colibri.mavlink.parameters.store import ParamError, Parameter, Parameters, ParamType, Value, float32
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT

_COLUMNS = 5
_MAX_ID = 255
_HEADER = "# Onboard parameters for Vehicle {system}\n#\n# Vehicle-Id Component-Id Name Value Type\n"


class ParameterFileError(MavlinkError):
    """An invalid parameter file; the message names line and parameter."""


def write(parameters: Parameters, system_id: int = 1) -> str:
    lines = [_HEADER.format(system=system_id)]
    for parameter in parameters:
        value = parameters[parameter.name]
        if value != parameter.default:
            cells = (system_id, AUTOPILOT_COMPONENT, parameter.name, _text(parameter, value), parameter.kind.value)
            lines.append("\t".join(map(str, cells)) + "\n")
    return "".join(lines)


def read(text: str, parameters: Parameters) -> dict[str, Value]:
    """Return the valid values of a file, without other components' and read-only parameters."""
    values: dict[str, Value] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        cells = line.split("\t")
        if len(cells) != _COLUMNS:
            raise ParameterFileError(f"line {number}: expected {_COLUMNS} columns between tabs, not {len(cells)}")
        try:
            parameter = _parameter(cells, parameters)
            value = None if parameter is None else _value(parameter, cells[3], cells[4])
        except ValueError as reason:
            raise ParameterFileError(f"line {number}: {cells[2]}: {reason}") from None
        if parameter is None or value is None or parameter.read_only:
            continue
        if parameter.name in values:
            raise ParameterFileError(f"line {number}: {parameter.name}: given twice")
        values[parameter.name] = value
    return values


def _parameter(cells: list[str], parameters: Parameters) -> Parameter | None:
    for what, cell in zip(("vehicle", "component"), cells, strict=False):
        if not cell.isascii() or not cell.isdigit() or int(cell) > _MAX_ID:
            raise ValueError(f'{what} id "{cell}": must be a number from 0 to {_MAX_ID}')
    if int(cells[1]) != AUTOPILOT_COMPONENT:
        return None
    index = parameters.index(cells[2])
    if index is None:
        raise ValueError("unknown parameter")
    return parameters.at(index)


def _value(parameter: Parameter, text: str, kind: str) -> Value:
    if kind != str(parameter.kind.value):
        raise ValueError(f'type must be {parameter.kind.value}, not "{kind}"')
    value: Value
    try:
        value = int(text) if parameter.kind == ParamType.INT else float32(float(text))
    except ValueError:
        raise ValueError(f"no number: {text!r}") from None
    if parameter.refusal(value) == ParamError.VALUE_OUT_OF_RANGE:
        raise ValueError(f"{text} is not {_choices(parameter)}")
    return value


def _choices(parameter: Parameter) -> str:
    if parameter.values:
        return "one of " + ", ".join(str(value) for value, _ in parameter.values)
    return f"from {_text(parameter, parameter.minimum)} to {_text(parameter, parameter.maximum)}"


def _text(parameter: Parameter, value: Value) -> str:
    return str(value) if parameter.kind == ParamType.INT else f"{value:.9g}"
