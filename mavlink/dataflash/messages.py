"""The messages of a DataFlash log: https://ardupilot.org/dev/docs/logmessages.html."""

from collections.abc import Callable, Sequence
from struct import Struct
from typing import NamedTuple

from colibri.mavlink.telemetry.encoder import FLOAT32_MAX

_MARKS = b"\xa3\x95"
_HEAD_BYTES = 3

_UNITS = (
    "-= s=s d=deg h=degheading D=deglatitude U=deglongitude k=deg/s E=rad/s m=m n=m/s o=m/s/s v=V "
    "A=A a=Ah X=W.h w=Ohm O=degC %=% Y=us S=satellites z=Hz #=instance"
)
_FACTORS = {"-": 0.0, "0": 1.0, "B": 1e-2, "C": 1e-3, "F": 1e-6, "G": 1e-7}
_FIRST_NUMBER = 128
_TABLE = """
FMT BBnNZ Type,Length,Name,Format,Columns -b--- -----
UNIT QbZ TimeUS,Id,Label s-- F--
MULT Qbd TimeUS,Id,Mult s-- F--
FMTU QBNN TimeUS,FmtType,UnitIds,MultIds s--- F---
PARM QNff TimeUS,Name,Value,Default s--- F---
MSG QZ TimeUS,Message s- F-
MODE QMBB TimeUS,Mode,ModeNum,Rsn s--- F---
ORGN QBLLe TimeUS,Type,Lat,Lng,Alt s-DUm F-GGB
ARM QBIBB TimeUS,ArmState,ArmChecks,Forced,Method s---- F----
EV QB TimeUS,Id s- F-
ERR QBB TimeUS,Subsys,ECode s-- F--
ATT QffffffB TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,AEKF sddddhh- F000000-
RATE Qffffffffffff TimeUS,RDes,R,ROut,PDes,P,POut,YDes,Y,YOut,ADes,A,AOut skk-kk-kk-oo- F00-00-00-00-
CTUN Qffffffefffhh TimeUS,ThI,ABst,ThO,ThH,DAlt,Alt,BAlt,DSAlt,SAlt,TAlt,DCRt,CRt s----mmmmmmnn F----00B000BB
POS QLLfff TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt sDUmmm FGG000
GPS QBBIHBcLLeffffB TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U s#-s-S-DUmnhnh- F--C-0BGGB0000-
IMU QBffffffIIfBBHH TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz s#EEEooo--O--zz F-000000--0--00
BAT QBfffffcfBBB TimeUS,Inst,Volt,VoltR,Curr,CurrTot,EnrgTot,Temp,Res,RemPct,H,SH s#vvAaXOw%-% F-000C00000-
"""
"""Messages by number: name, types of the fields, names of the columns, units, multipliers."""


class _Format(NamedTuple):
    name: str
    fields: str
    columns: str
    units: str
    multipliers: str


_CHANNELS = ",".join(f"C{number}" for number in range(1, 15))
_OUTPUTS = f"RCOU Q{14 * 'H'} TimeUS,{_CHANNELS} s{14 * 'Y'} F{14 * '0'}"
_AXIS = "PSC{0} Qfffffffff TimeUS,DP{0},TP{0},P{0},DV{0},TV{0},V{0},DA{0},TA{0},A{0} smmmnnnooo F000000000"
_ROWS = (*_TABLE.strip().splitlines(), _OUTPUTS, *map(_AXIS.format, "NED"))
_FORMATS = {number: _Format(*row.split()) for number, row in enumerate(_ROWS, start=_FIRST_NUMBER)}

Value = float | str


def message(name: str, *values: Value) -> bytes:
    """Encode a message: angles in degrees, lengths in m, times in µs; numbers are clamped, unknown integers 0."""
    pack, converters = _CODECS[name]
    return pack(*[convert(value) for convert, value in zip(converters, values, strict=True)])


def beginning(time_us: int) -> bytes:
    formats = [
        message("FMT", number, _struct(each.fields).size + _HEAD_BYTES, each.name, each.fields, each.columns)
        for number, each in _FORMATS.items()
    ]
    units = [message("UNIT", time_us, ord(pair[0]), pair[2:]) for pair in _UNITS.split()]
    factors = [message("MULT", time_us, ord(letter), factor) for letter, factor in _FACTORS.items()]
    columns = [message("FMTU", time_us, number, each.units, each.multipliers) for number, each in _FORMATS.items()]
    return b"".join([*formats, *units, *factors, *columns])


def _text(value: Value) -> bytes:
    return str(value).encode(errors="replace")


def _whole(low: int, high: int, factor: float) -> Callable[[Value], int]:
    def convert(value: Value) -> int:
        scaled = factor * float(value)
        return 0 if scaled != scaled else high if scaled >= high else low if scaled <= low else round(scaled)

    return convert


def _integer(code: str, factor: float = 1.0) -> tuple[str, Callable[[Value], int]]:
    bits = 8 * Struct(f"<{code}").size
    low, high = (0, 2**bits - 1) if code.isupper() else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    return code, _whole(low, high, factor)


_FIELDS: dict[str, tuple[str, Callable[[Value], int | float | bytes]]] = {
    "f": ("f", lambda value: max(min(float(value), FLOAT32_MAX), -FLOAT32_MAX)),  # nan stays
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


def _codec(number: int, each: _Format) -> tuple[Callable[..., bytes], Sequence[Callable[[Value], int | float | bytes]]]:
    pack, head = _struct(each.fields).pack, _MARKS + bytes([number])
    return lambda *values: head + pack(*values), [_FIELDS[field][1] for field in each.fields]


_CODECS = {each.name: _codec(number, each) for number, each in _FORMATS.items()}
