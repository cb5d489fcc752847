"""Everything that telemetry tells of a vehicle on the ground; of wind it knows nothing there."""

import sys
from time import time

from mavsdk.plugins.info import Info
from mavsdk.plugins.telemetry import FixType, FlightMode, LandedState, Telemetry

from tests.clients.mavsdk_scripts.connection import connected, until

STREAMS = (
    "position",
    "home",
    "in_air",
    "landed_state",
    "armed",
    "attitude_quaternion",
    "attitude_euler",
    "attitude_angular_velocity_body",
    "velocity_ned",
    "gps_info",
    "raw_gps",
    "battery",
    "flight_mode",
    "health",
    "rc_status",
    "actuator_output_status",
    "odometry",
    "position_velocity_ned",
    "ground_truth",
    "imu",
    "scaled_imu",
    "raw_imu",
    "health_all_ok",
    "unix_epoch_time",
    "distance_sensor",
    "scaled_pressure",
    "heading",
    "altitude",
    "actuator_control_target",
    "fixedwing_metrics",
)
RATE_HZ = 10.0


def main(url: str) -> None:
    with connected(url) as vehicle:
        telemetry = Telemetry(vehicle)
        heard: set[str] = set()
        for name in STREAMS:
            ask = getattr(telemetry, f"set_rate_{name}", None)
            if ask is not None:
                ask(RATE_HZ)
            getattr(telemetry, f"subscribe_{name}")(lambda *_, name=name: heard.add(name))
        until(lambda: heard == set(STREAMS), "every stream", 10.0)
        until(telemetry.health_all_ok, "good health", 5.0)
        home, position = telemetry.home(), telemetry.position()
        assert abs(position.latitude_deg - home.latitude_deg) < 1e-6
        assert abs(position.longitude_deg - home.longitude_deg) < 1e-6
        assert abs(position.relative_altitude_m) < 0.05
        assert abs(telemetry.imu().acceleration_frd.down_m_s2 + 9.81) < 0.05
        assert abs(telemetry.attitude_euler().yaw_deg) < 0.1
        assert telemetry.flight_mode() == FlightMode.HOLD
        assert telemetry.landed_state() == LandedState.ON_GROUND
        assert telemetry.gps_info().fix_type >= FixType.FIX_3D
        assert 90.0 < telemetry.battery().remaining_percent <= 100.0
        assert abs(telemetry.unix_epoch_time() * 1e-6 - time()) < 3600.0
        assert not telemetry.armed()
        assert abs(telemetry.get_gps_global_origin().latitude_deg - home.latitude_deg) < 1e-6
        version = Info(vehicle).get_version()
        assert (version.flight_sw_major, version.flight_sw_minor) != (0, 0)


if __name__ == "__main__":
    main(sys.argv[1])
