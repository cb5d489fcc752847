"""Messages of battery, rotors and speed controllers."""

from math import isfinite, pi

from colibri.common.types import PerRotor
from colibri.mavlink.node.service import Fields
from colibri.mavlink.telemetry.encoder import UNKNOWN_I16, UNKNOWN_U8, UNKNOWN_U16
from colibri.mavlink.telemetry.snapshot import BatteryState, TelemetrySnapshot
from colibri.mavlink.wire.dialect import mav

CELLS = 10
"""Capacity of BATTERY_STATUS; four more cells go into its extension."""
CELLS_EXTENDED = 4
HECTOJOULES_PER_WH = 36.0
RPM = 60.0 / (2.0 * pi)
LOW_US, SPAN_US = 1000.0, 1000.0
OUTPUTS = 32
ROTORS = 4
ALL_ROTORS = 2**ROTORS - 1
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


def esc_status(s: TelemetrySnapshot) -> Fields:
    """ESC_STATUS (291): rpm, V, A; current shared by rotor power, the cube of its speed."""
    cubes = [speed * speed * speed for speed in s.rotor_speeds_rad_s]
    total = sum(cubes) or 1.0
    voltage, current = (s.battery.voltage_v, s.battery.current_a) if s.battery else (0.0, 0.0)
    rpm = tuple(RPM * speed for speed in s.rotor_speeds_rad_s)
    return (0, s.time_us, rpm, (voltage,) * ROTORS, tuple(current * cube / total for cube in cubes))


def esc_info(s: TelemetrySnapshot) -> Fields:
    """ESC_INFO (290): four healthy controllers, temperature unknown."""
    packets = s.time_us // 1_000_000 % 2**16
    healthy = ((0,) * ROTORS, (0,) * ROTORS, (UNKNOWN_I16,) * ROTORS)
    return (0, s.time_us, packets, ROTORS, ESC_CONNECTION_TYPE_DSHOT, ALL_ROTORS, *healthy)


def servo_output_raw(s: TelemetrySnapshot) -> Fields:
    """SERVO_OUTPUT_RAW (36): 1000 to 2000 µs; time in µs, wraps after 71 minutes."""
    return (s.time_us % 2**32, 0, *_pulses_us(s.controls), *(0,) * 12)


def actuator_output_status(s: TelemetrySnapshot) -> Fields:
    """ACTUATOR_OUTPUT_STATUS (375): pulses as in SERVO_OUTPUT_RAW."""
    return (s.time_us, ALL_ROTORS, (*_pulses_us(s.controls), *(0.0,) * (OUTPUTS - ROTORS)))


def actuator_control_target(s: TelemetrySnapshot) -> Fields:
    """ACTUATOR_CONTROL_TARGET (140), group 0: roll, pitch, yaw (FRD) and thrust of the rotor controls.

    Rotors of a plus frame: front (counter-clockwise), right, rear, left.
    """
    front, right, rear, left = s.controls
    moments = (0.5 * (left - right), 0.5 * (front - rear), 0.5 * (front - right + rear - left))
    return (s.time_us, MIXED_GROUP, (*moments, 0.25 * (front + right + rear + left), 0.0, 0.0, 0.0, 0.0))


def rc_channels(s: TelemetrySnapshot) -> Fields:
    """RC_CHANNELS (65): MANUAL_CONTROL as roll, pitch, throttle and yaw, 1000 to 2000 µs."""
    from_boot_ms = s.time_us // 1000 % 2**32
    if s.sticks is None:
        return (from_boot_ms, 0, *(UNKNOWN_U16,) * 18, UNKNOWN_U8)
    pitch, roll, thrust, yaw = s.sticks
    sticks = (_stick_us(roll), _stick_us(pitch), LOW_US + SPAN_US * thrust, _stick_us(yaw))
    return (from_boot_ms, len(sticks), *sticks, *(UNKNOWN_U16,) * 14, UNKNOWN_U8)


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
