"""Snapshots that the tests of telemetry tell: one whose every number is known, and arbitrary ones."""

from math import pi
from typing import Any

from hypothesis import strategies as st

from colibri.common.earth.geodesy import Geodetic
from colibri.common.rotations import quaternion_from_euler
from colibri.mavlink.telemetry.encoder import Encoder
from colibri.mavlink.telemetry.snapshot import (
    BatteryState,
    Forecast,
    HomePosition,
    Setpoint,
    SolverState,
    TelemetrySnapshot,
)
from colibri.mavlink.telemetry.table import telemetry
from colibri.mavlink.wire.dialect import Codec

TELEMETRY = telemetry()
ORIGIN = Geodetic(47.0, 8.0, 400.0)
YAW_NORTH = pi / 2
FORECASTS = tuple(
    Forecast(0.1 * k, (k, 2.0 * k, 3.0 * k), (0.1 * k, 0.0, 0.0), (0.0, 0.1 * k, 0.0), YAW_NORTH, 0.5)
    for k in range(1, 11)
)
FLYING = TelemetrySnapshot(
    time_us=12_345_678,
    armed=True,
    custom_mode=3 << 16,
    intended_custom_mode=4 << 16,
    standard_mode=1,
    landed_state=2,
    position_enu_m=(10.0, 20.0, 30.0),
    velocity_enu_m_s=(3.0, 4.0, -1.5),
    attitude=quaternion_from_euler(0.1, 0.2, YAW_NORTH),
    rate_flu_rad_s=(0.1, 0.2, 0.3),
    origin=ORIGIN,
    home=HomePosition((1.0, 2.0, 5.0), 0.0),
    rotor_speeds_rad_s=(100.0, 200.0, 100.0, 200.0),
    controls=(0.5, 0.6, 0.7, 0.8),
    battery=BatteryState(3, 11.1, 14.0, 0.5, 0.1, 240.0, 5.0, 2),
    setpoint=Setpoint(
        position_enu_m=(13.0, 24.0, 32.0),
        velocity_enu_m_s=(1.0, 2.0, 3.0),
        yaw_rad=0.0,
        attitude=quaternion_from_euler(0.1, 0.2, 0.0),
        rate_flu_rad_s=(0.1, 0.2, 0.3),
        thrust=0.55,
    ),
    solver=SolverState(0, -1, 7, 1e-4, 2e-4, 5.5, 0.25, (1, 2, 3, 4), ((0.1, 0.2, 0.3, 0.4),) * 2, FORECASTS),
    wind_enu_m_s=(1.0, 2.0, 0.0),
    sticks=(0.5, -0.5, 0.25, 1.0),
    flight_started_us=1_000_000,
    takeoff_us=2_000_000,
    landing_us=0,
    flights=4,
    load=0.125,
)

NOT_TOLD: dict[str, Any] = {"sensed": st.none(), "fix": st.none(), "latest": st.just({}), "estimator": st.none()}
ARBITRARY = st.builds(
    TelemetrySnapshot, **dict.fromkeys(set(TelemetrySnapshot.__struct_fields__) - set(NOT_TOLD), ...), **NOT_TOLD
)


def sent(name: str, snapshot: TelemetrySnapshot, table: dict[str, Encoder] = TELEMETRY) -> list[Any]:
    """Return the fields that arrive when `snapshot` is told by messages `name`."""
    fields = table[name](snapshot)
    messages = [] if fields is None else fields if isinstance(fields, list) else [fields]
    codec = Codec(1, 1)
    received = [message for one in messages for message in codec.decode(codec.encode(name, *one))]
    assert [message.name for message in received] == [name] * len(messages)
    return [message.fields for message in received]
