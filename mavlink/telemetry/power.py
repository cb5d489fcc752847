"""Messages of battery, rotors and speed controllers."""

from math import isfinite, pi
from operator import mul

from colibri.common.types import PerRotor
from colibri.mavlink.node.service import Fields
from colibri.mavlink.telemetry.encoder import UNKNOWN_I16, UNKNOWN_U8, UNKNOWN_U16
from colibri.mavlink.telemetry.snapshot import BatteryState, TelemetrySnapshot
from colibri.mavlink.wire.dialect import mav

CELLS = 10  # capacity of BATTERY_STATUS; four more cells go into its extension
CELLS_EXTENDED = 4
HECTOJOULES_PER_WH = 36.0
RPM = 60.0 / (2.0 * pi)
LOW_US, SPAN_US = 1000.0, 1000.0
OUTPUTS = 32
_SERVOS = 16
_ESCS = 4  # of one ESC_STATUS or ESC_INFO
ESC_CONNECTION_TYPE_DSHOT = 5
MIXED_GROUP = 0


def battery_status(s: TelemetrySnapshot) -> Fields | None:
    """BATTERY_STATUS (147): mV a cell, cA, mAh, hJ, percent, s."""
    battery = s.battery
    if battery is None:
        return None
    kind = (0, mav.MAV_BATTERY_FUNCTION_ALL, mav.MAV_BATTERY_TYPE_LIPO, UNKNOWN_I16)
    cells, more = _cells_mv(battery)
    used = (1e3 * battery.used_ah, HECTOJOULES_PER_WH * battery.used_wh)
    left_s = battery.remaining_s if isfinite(battery.remaining_s) else 0.0
    left = (100.0 * battery.remaining, left_s, battery.charge_state)
    return (*kind, cells, 100.0 * battery.current_a, *used, *left, more, 0, 0)


def esc_status(s: TelemetrySnapshot) -> list[Fields]:
    """ESC_STATUS (291), four rotors each: rpm, V, A; current shared by rotor power, the cube of its speed."""
    cubes = [speed * speed * speed for speed in s.rotor_speeds_rad_s]
    total = sum(cubes) or 1.0
    voltage, current = (s.battery.voltage_v, s.battery.current_a) if s.battery else (0.0, 0.0)
    rpm = [RPM * speed for speed in s.rotor_speeds_rad_s]
    currents, voltages = [current * cube / total for cube in cubes], [voltage] * len(rpm)
    return [
        (first, s.time_us, *(_four(numbers[first : first + _ESCS]) for numbers in (rpm, voltages, currents)))
        for first in range(0, len(rpm), _ESCS)
    ]


def esc_info(s: TelemetrySnapshot) -> list[Fields]:
    """ESC_INFO (290), four rotors each: healthy controllers, temperature unknown."""
    packets, rotors = s.time_us // 1_000_000 % 2**16, len(s.controls)
    healthy = ((0,) * _ESCS, (0,) * _ESCS, (UNKNOWN_I16,) * _ESCS)
    facts = (s.time_us, packets, rotors, ESC_CONNECTION_TYPE_DSHOT, _all(rotors), *healthy)
    return [(first, *facts) for first in range(0, rotors, _ESCS)]


def servo_output_raw(s: TelemetrySnapshot) -> Fields:
    """SERVO_OUTPUT_RAW (36): 1000 to 2000 µs; time in µs, wraps after 71 minutes."""
    return (s.time_us % 2**32, 0, *_pulses_us(s.controls), *(0,) * (_SERVOS - len(s.controls)))


def actuator_output_status(s: TelemetrySnapshot) -> Fields:
    """ACTUATOR_OUTPUT_STATUS (375): pulses as in SERVO_OUTPUT_RAW."""
    rotors = len(s.controls)
    return (s.time_us, _all(rotors), (*_pulses_us(s.controls), *(0.0,) * (OUTPUTS - rotors)))


def actuator_control_target(s: TelemetrySnapshot) -> Fields:
    """ACTUATOR_CONTROL_TARGET (140), group 0: roll, pitch, yaw (FRD) and thrust of the rotor controls."""
    mixed = [sum(map(mul, levers, s.controls)) for levers in s.levers]
    return (s.time_us, MIXED_GROUP, (*mixed, sum(s.controls) / len(s.controls), 0.0, 0.0, 0.0, 0.0))


def rc_channels(s: TelemetrySnapshot) -> Fields:
    """RC_CHANNELS (65): MANUAL_CONTROL as roll, pitch, throttle and yaw, 1000 to 2000 µs."""
    if s.sticks is None:
        return (s.boot_ms, 0, *(UNKNOWN_U16,) * 18, UNKNOWN_U8)
    pitch, roll, thrust, yaw = s.sticks
    sticks = (_stick_us(roll), _stick_us(pitch), LOW_US + SPAN_US * thrust, _stick_us(yaw))
    return (s.boot_ms, len(sticks), *sticks, *(UNKNOWN_U16,) * 14, UNKNOWN_U8)


def _all(rotors: int) -> int:
    return (1 << rotors) - 1


def _four(numbers: list[float]) -> tuple[float, ...]:
    return (*numbers, *(0.0,) * (_ESCS - len(numbers)))


def _stick_us(stick: float) -> float:
    return LOW_US + 0.5 * SPAN_US * (1.0 + stick)


def _pulses_us(controls: PerRotor) -> tuple[float, ...]:
    return tuple(LOW_US + SPAN_US * control for control in controls)


def _cells_mv(battery: BatteryState) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the voltages of the first ten cells and of the next four, with BATTERY_STATUS's fillers."""
    if not 1 <= battery.cells <= CELLS + CELLS_EXTENDED:
        return (1e3 * battery.voltage_v, *(UNKNOWN_U16,) * (CELLS - 1)), (0,) * CELLS_EXTENDED
    cell_mv = 1e3 * battery.voltage_v / battery.cells
    first, more = min(battery.cells, CELLS), max(0, battery.cells - CELLS)
    extended = (max(1.0, cell_mv),) * more + (0,) * (CELLS_EXTENDED - more)
    return (cell_mv,) * first + (UNKNOWN_U16,) * (CELLS - first), extended
