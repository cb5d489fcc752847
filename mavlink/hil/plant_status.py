"""The plant's messages beside a frame: battery, results of faults, delay of commands."""

from collections.abc import Sequence
from math import nan
from typing import NamedTuple

from colibri.common.records import Record
from colibri.mavlink.hil import faults
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.wire.dialect import Codec, Message, mav

_NO_CELL = 65535
_MAX_MV = 65534
_UNKNOWN_TEMPERATURE = 32767
_DELAY = "cmd_delay"
_MAX_I32 = 2**31 - 1


class PlantBattery(Record, frozen=True):
    voltage_v: float  # nan without a battery
    current_a: float
    used_ah: float  # since full
    remaining: float  # 0..1

    @property
    def exists(self) -> bool:
        return self.voltage_v == self.voltage_v


NO_BATTERY = PlantBattery(nan, 0.0, 0.0, 1.0)


class FaultResult(NamedTuple):
    unit: int
    kind: int
    result: int


class PlantStatus(Record, frozen=True):
    battery: PlantBattery | None = None
    results: tuple[FaultResult, ...] = ()  # of faults in the previous answer
    delay_us: int | None = None  # from the last command's frame to its effect, if any


NOTHING = PlantStatus()


class ReceivedFrame(Record, frozen=True):
    frame: Frame
    plant_status: PlantStatus = NOTHING


def encode_battery(codec: Codec, battery: PlantBattery) -> bytes:
    """Encode a battery as BATTERY_STATUS: the pack as its first cell, or no cell."""
    voltage_mv = min(round(1e3 * battery.voltage_v), _MAX_MV) if battery.exists else _NO_CELL
    voltages = (voltage_mv, *(_NO_CELL,) * 9)
    kind = (0, mav.MAV_BATTERY_FUNCTION_ALL, mav.MAV_BATTERY_TYPE_LIPO, _UNKNOWN_TEMPERATURE)
    current = min(round(100.0 * battery.current_a), 32767)
    return codec.encode(
        "BATTERY_STATUS", *kind, voltages, current, round(1e3 * battery.used_ah), -1, round(100.0 * battery.remaining)
    )


def decode_battery(message: Message) -> PlantBattery | None:
    fields = message.fields
    cells_mv = [cell for cell in fields.voltages if cell != _NO_CELL]
    if fields.current_consumed < 0 or not 0 <= fields.battery_remaining <= 100:
        return None
    if not cells_mv:
        return NO_BATTERY if fields.current_battery == 0 else None
    current_a = max(0.0, fields.current_battery / 100.0)
    return PlantBattery(sum(cells_mv) / 1e3, current_a, fields.current_consumed / 1e3, fields.battery_remaining / 100.0)


def encode_results(codec: Codec, results: Sequence[FaultResult], target: tuple[int, int]) -> list[bytes]:
    """Encode results as COMMAND_ACK; `result_param2` is 256 unit + type."""
    return [
        codec.encode("COMMAND_ACK", faults.COMMAND, it.result, 0, it.unit << 8 | it.kind, *target) for it in results
    ]


def encode_delay(codec: Codec, time_us: int, delay_us: int) -> bytes:
    return codec.encode("NAMED_VALUE_INT", time_us // 1000, _DELAY, min(delay_us, _MAX_I32))


def decode_delay(message: Message) -> int | None:
    fields = message.fields
    return fields.value if fields.name == _DELAY and fields.value >= 0 else None


def decode_result(message: Message) -> FaultResult:
    unit, kind = divmod(message.fields.result_param2, 256)
    return FaultResult(unit, kind, message.fields.result)
