"""A DataFlash log as ArduPilot's own reader reads it."""

from pathlib import Path
from typing import Any

from pymavlink.DFReader import DFReader_binary


def read_dataflash(path: Path, content: bytes) -> tuple[int, dict[str, list[Any]]]:
    """Write a log to `path`; return the MAV_TYPE that it is recognized by, and its messages by name."""
    path.write_bytes(content)
    log = DFReader_binary(str(path))
    try:
        found: dict[str, list[Any]] = {}
        while (row := log.recv_msg()) is not None:
            found.setdefault(row.get_type(), []).append(row)
        return log.mav_type, found
    finally:
        log.data_map.close()
        log.filehandle.close()
