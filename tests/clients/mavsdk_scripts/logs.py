"""The log of a short flight, downloaded into the folder where the script runs."""

import sys

from mavsdk.plugins.log_files import LogFiles, LogFilesResult

from tests.clients.mavsdk_scripts.connection import connected, streamed, take_off, until


def main(url: str) -> None:
    with connected(url) as vehicle:
        action, telemetry = take_off(vehicle, 1.5)
        action.land()
        until(lambda: not telemetry.armed(), "the rotors to stop")
        logs = LogFiles(vehicle)
        (entry,) = logs.get_entries()
        more = LogFilesResult.NEXT
        streamed(lambda report: logs.download_log_file_async(entry, "flight.log", report), more)


if __name__ == "__main__":
    main(sys.argv[1])
