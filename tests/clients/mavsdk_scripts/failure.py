"""Failure injection: only where a parameter allows it; then GPS is off, and on again."""

import sys

from mavsdk.plugins.failure import Failure, FailureResult, FailureType, FailureUnit
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import FixType, Telemetry

from tests.clients.mavsdk_scripts.connection import connected, refused, until

ENABLE = "SYS_FAILURE_EN"


def main(url: str) -> None:
    with connected(url) as vehicle:
        telemetry, failure, param = Telemetry(vehicle), Failure(vehicle), Param(vehicle)
        until(lambda: telemetry.gps_info().fix_type >= FixType.FIX_3D, "a fix")
        refused(lambda: failure.inject(FailureUnit.SENSOR_GPS, FailureType.OFF, 0), FailureResult.DISABLED)
        param.set_param_int(ENABLE, 1)
        failure = Failure(vehicle)  # one that reads the parameter anew
        failure.inject(FailureUnit.SENSOR_GPS, FailureType.OFF, 0)
        until(lambda: telemetry.gps_info().fix_type < FixType.FIX_2D, "no fix")
        failure.inject(FailureUnit.SENSOR_GPS, FailureType.OK, 0)
        until(lambda: telemetry.gps_info().fix_type >= FixType.FIX_3D, "a fix again")
        param.set_param_int(ENABLE, 0)


if __name__ == "__main__":
    main(sys.argv[1])
