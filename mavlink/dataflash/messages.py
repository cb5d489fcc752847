"""The messages of a DataFlash log, as bytes.

Specification: https://ardupilot.org/dev/docs/logmessages.html. A message is two marks, its number and fields without
gaps. The log itself defines each message (FMT), the units and multipliers of its columns (FMTU, UNIT, MULT).
"""

from collections.abc import Callable, Sequence
from struct import Struct
from typing import NamedTuple

from colibri.mavlink.telemetry.encoder import FLOAT32_MAX

_MARKS = b"\xa3\x95"
_HEAD_BYTES = 3

_UNITS = {
    "-": "",
    "s": "s",
    "d": "deg",
    "h": "degheading",
    "D": "deglatitude",
    "U": "deglongitude",
    "k": "deg/s",
    "E": "rad/s",
    "m": "m",
    "n": "m/s",
    "o": "m/s/s",
    "v": "V",
    "A": "A",
    "a": "Ah",
    "X": "W.h",
    "w": "Ohm",
    "O": "degC",
    "%": "%",
    "Y": "us",
    "S": "satellites",
    "z": "Hz",
    "#": "instance",
}
_FACTORS = {"-": 0.0, "0": 1.0, "B": 1e-2, "C": 1e-3, "F": 1e-6, "G": 1e-7}


class _Format(NamedTuple):
    number: int
    fields: str
    columns: str
    units: str
    multipliers: str


_AXES = {"N": 1, "E": 2, "D": 3}
_FORMATS = {
    "FMT": _Format(128, "BBnNZ", "Type,Length,Name,Format,Columns", "-b---", "-----"),
    "UNIT": _Format(129, "QbZ", "TimeUS,Id,Label", "s--", "F--"),
    "MULT": _Format(130, "Qbd", "TimeUS,Id,Mult", "s--", "F--"),
    "FMTU": _Format(131, "QBNN", "TimeUS,FmtType,UnitIds,MultIds", "s---", "F---"),
    "PARM": _Format(132, "QNff", "TimeUS,Name,Value,Default", "s---", "F---"),
    "MSG": _Format(133, "QZ", "TimeUS,Message", "s-", "F-"),
    "MODE": _Format(134, "QMBB", "TimeUS,Mode,ModeNum,Rsn", "s---", "F---"),
    "ORGN": _Format(135, "QBLLe", "TimeUS,Type,Lat,Lng,Alt", "s-DUm", "F-GGB"),
    "ARM": _Format(136, "QBIBB", "TimeUS,ArmState,ArmChecks,Forced,Method", "s----", "F----"),
    "EV": _Format(137, "QB", "TimeUS,Id", "s-", "F-"),
    "ERR": _Format(138, "QBB", "TimeUS,Subsys,ECode", "s--", "F--"),
    "ATT": _Format(139, "QffffffB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,AEKF", "sddddhh-", "F000000-"),
    "RATE": _Format(
        140,
        "Qffffffffffff",
        "TimeUS,RDes,R,ROut,PDes,P,POut,YDes,Y,YOut,ADes,A,AOut",
        "skk-kk-kk-oo-",
        "F00-00-00-00-",
    ),
    "CTUN": _Format(
        141,
        "Qffffffefffhh",
        "TimeUS,ThI,ABst,ThO,ThH,DAlt,Alt,BAlt,DSAlt,SAlt,TAlt,DCRt,CRt",
        "s----mmmmmmnn",
        "F----00B000BB",
    ),
    "POS": _Format(142, "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt", "sDUmmm", "FGG000"),
    "GPS": _Format(
        143,
        "QBBIHBcLLeffffB",
        "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U",
        "s#-s-S-DUmnhnh-",
        "F--C-0BGGB0000-",
    ),
    "IMU": _Format(
        144,
        "QBffffffIIfBBHH",
        "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz",
        "s#EEEooo--O--zz",
        "F-000000--0--00",
    ),
    "BAT": _Format(
        145,
        "QBfffffcfBBB",
        "TimeUS,Inst,Volt,VoltR,Curr,CurrTot,EnrgTot,Temp,Res,RemPct,H,SH",
        "s#vvAaXOw%-%",
        "F-000C00000-",
    ),
    "RCOU": _Format(
        146, "Q" + 14 * "H", "TimeUS," + ",".join(f"C{n}" for n in range(1, 15)), "s" + 14 * "Y", "F" + 14 * "0"
    ),
} | {
    f"PSC{axis}": _Format(
        146 + number,
        "Qfffffffff",
        f"TimeUS,DP{axis},TP{axis},P{axis},DV{axis},TV{axis},V{axis},DA{axis},TA{axis},A{axis}",
        "smmmnnnooo",
        "F000000000",
    )
    for axis, number in _AXES.items()
}

Value = float | str


def message(name: str, *values: Value) -> bytes:
    """Encode a message: angles in degrees, lengths in m, times in µs; numbers are clamped, unknown integers 0."""
    pack, converters = _CODECS[name]
    return pack(*[convert(value) for convert, value in zip(converters, values, strict=True)])


def beginning(time_us: int) -> bytes:
    """Return the definitions that a log begins with."""
    formats = [
        message("FMT", each.number, _struct(each.fields).size + _HEAD_BYTES, name, each.fields, each.columns)
        for name, each in _FORMATS.items()
    ]
    units = [message("UNIT", time_us, ord(unit), label) for unit, label in _UNITS.items()]
    factors = [message("MULT", time_us, ord(letter), factor) for letter, factor in _FACTORS.items()]
    columns = [message("FMTU", time_us, each.number, each.units, each.multipliers) for each in _FORMATS.values()]
    return b"".join([*formats, *units, *factors, *columns])


def _text(value: Value) -> bytes:
    return str(value).encode(errors="replace")


def _single(value: Value) -> float:
    return max(min(float(value), FLOAT32_MAX), -FLOAT32_MAX)  # nan stays


def _whole(low: int, high: int, factor: float) -> Callable[[Value], int]:
    def convert(value: Value) -> int:
        scaled = factor * float(value)
        return 0 if scaled != scaled else high if scaled >= high else low if scaled <= low else round(scaled)

    return convert


def _integer(code: str, factor: float = 1.0) -> tuple[str, Callable[[Value], int]]:
    bits = 8 * Struct(f"<{code}").size
    return (
        code,
        _whole(0, 2**bits - 1, factor) if code.isupper() else _whole(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1, factor),
    )


_FIELDS: dict[str, tuple[str, Callable[[Value], int | float | bytes]]] = {
    "f": ("f", _single),
    "d": ("d", float),
    "n": ("4s", _text),
    "N": ("16s", _text),
    "Z": ("64s", _text),
    "M": _integer("B"),
    "L": _integer("i", 1e7),
    "c": _integer("h", 100.0),
    "e": _integer("i", 100.0),
    **{code: _integer(code) for code in "bBhHiIqQ"},
}


def _struct(fields: str) -> Struct:
    return Struct("<" + "".join(_FIELDS[field][0] for field in fields))


def _codec(each: _Format) -> tuple[Callable[..., bytes], Sequence[Callable[[Value], int | float | bytes]]]:
    pack, head = _struct(each.fields).pack, _MARKS + bytes([each.number])
    return lambda *values: head + pack(*values), [_FIELDS[field][1] for field in each.fields]


_CODECS = {name: _codec(each) for name, each in _FORMATS.items()}
