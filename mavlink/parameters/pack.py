"""`@PARAM/param.pck`, all parameters in one file: https://mavlink.io/en/services/parameter_ftp.html."""

from struct import Struct, pack

from colibri.mavlink.parameters.store import Parameter, Parameters, ParamType, bits_of
from colibri.mavlink.wire.dialect import mav

BLOCK_BYTES = 239  # read size of clients: a value must not cross a block boundary

_HEADER = Struct("<HHH")  # magic, parameters in this file, parameters in all
_MAGIC, _MAGIC_WITH_DEFAULTS = 0x671B, 0x671C
_TYPES = {ParamType.INT: 3, ParamType.REAL: 4}
_HAS_DEFAULT = 0x10
_NARROW = {mav.MAV_PARAM_TYPE_INT8: (1, "<b"), mav.MAV_PARAM_TYPE_INT16: (2, "<h")}  # type, layout
_MAX_COMMON_CHARS = 15


def packed(parameters: Parameters, query: str = "") -> bytes | None:
    wanted = {"withdefaults": 0, "start": 0, "count": 0}
    for pair in filter(None, query.split("&")):
        key, _, digits = pair.partition("=")
        if key not in wanted:
            continue
        if not digits.isascii() or not digits.isdigit() or len(digits) > 5:
            return None
        wanted[key] = int(digits)
    with_defaults, start, count = wanted["withdefaults"] == 1, wanted["start"], wanted["count"]
    if start >= max(len(parameters), 1):
        return None
    chosen = tuple(parameters)[start : start + count if count else None]
    magic = _MAGIC_WITH_DEFAULTS if with_defaults else _MAGIC
    file = bytearray(_HEADER.pack(magic, len(chosen), len(parameters)))
    before = ""
    for parameter in chosen:
        value = _bytes(parameter, parameters[parameter.name])
        default = _bytes(parameter, parameter.default) if with_defaults else value
        values = value if default == value else value + default
        entry = _name(parameter, before, len(values) > len(value)) + values
        past = (len(file) + len(entry)) % BLOCK_BYTES
        if 0 < past < len(values):
            file += bytes(len(values) - past)
        file += entry
        before = parameter.name
    return bytes(file)


def _name(parameter: Parameter, before: str, has_default: bool) -> bytes:
    """Return type, lengths, and the part of the name that is new."""
    maximum = min(len(before), len(parameter.name) - 1, _MAX_COMMON_CHARS)
    common = next((i for i in range(maximum) if before[i] != parameter.name[i]), maximum)
    own = parameter.name[common:].encode()
    kind, _ = _NARROW.get(parameter.wire, (_TYPES[parameter.kind], ""))
    kind |= _HAS_DEFAULT if has_default else 0
    return bytes((kind, (len(own) - 1) << 4 | common)) + own


def _bytes(parameter: Parameter, value: float) -> bytes:
    if parameter.wire in _NARROW:
        return pack(_NARROW[parameter.wire][1], int(value))
    return bits_of(parameter.kind, value).to_bytes(4, "little")
