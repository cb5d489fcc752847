"""The four calibrations of PX4, one after another."""

import sys

from mavsdk.plugins.calibration import Calibration, CalibrationResult

from tests.clients.mavsdk_scripts.connection import connected, streamed


def main(url: str) -> None:
    with connected(url) as vehicle:
        calibration = Calibration(vehicle)
        for kind in ("gyro", "accelerometer", "magnetometer", "level_horizon"):
            begin = getattr(calibration, f"calibrate_{kind}_async")
            progress = [report.progress for report in streamed(begin, CalibrationResult.NEXT) if report.has_progress]
            assert progress, kind
            assert progress == sorted(progress), (kind, progress)
            assert abs(progress[-1] - 1.0) < 1e-6, (kind, progress)


if __name__ == "__main__":
    main(sys.argv[1])
