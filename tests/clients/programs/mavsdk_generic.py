"""MAVSDK 4 with a vehicle that says it is no PX4: what it then does not ask for, and a flight."""

import sys

from mavsdk.plugins.action import ActionResult
from mavsdk.plugins.calibration import Calibration, CalibrationResult
from mavsdk.plugins.telemetry import FlightMode

from tests.clients.mavsdk_scripts.connection import connected, refused, take_off, until

HEIGHT_M = 3.0


def main(url: str) -> None:
    with connected(url) as vehicle:
        action, telemetry = take_off(vehicle, HEIGHT_M)
        refused(action.get_return_to_launch_altitude, ActionResult.UNSUPPORTED)
        refusals: list[object] = []
        Calibration(vehicle).calibrate_gyro_async(lambda result, *_: refusals.append(result))
        until(lambda: refusals, "a word on the calibration")
        assert refusals == [CalibrationResult.UNSUPPORTED], refusals
        action.return_to_launch()
        until(lambda: telemetry.flight_mode() == FlightMode.RETURN_TO_LAUNCH, "the return")
        until(lambda: not telemetry.armed(), "the rotors to stop")


if __name__ == "__main__":
    main(sys.argv[1])
