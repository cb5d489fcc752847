"""Reader of DataFlash logs, with pymavlink's DFReader."""

from collections import defaultdict
from collections.abc import Collection
from contextlib import closing, redirect_stderr
from io import StringIO
from pathlib import Path
from typing import Any

from pymavlink.DFReader import DFReader_binary

from colibri.common.files import read_bytes
from colibri.mavlink.errors import MavlinkError

_MARKS = b"\xa3\x95"


class DataFlashError(MavlinkError):
    """The file is not a DataFlash log."""


def read_dataflash(path: Path, names: Collection[str]) -> tuple[dict[str, dict[str, list[Any]]], dict[str, float]]:
    """Return the columns of some messages, by name and instance as in IMU0, and all parameters' last values."""
    tables: dict[str, dict[str, list[Any]]] = defaultdict(lambda: defaultdict(list))
    parameters: dict[str, float] = {}
    try:
        if not read_bytes(path).startswith(_MARKS):
            raise DataFlashError(f"{path} is not a DataFlash log")
        with redirect_stderr(StringIO()), closing(DFReader_binary(str(path))) as log:  # it skips bad bytes
            while (row := log.recv_match(type=["PARM", *names])) is not None:
                if row.get_type() == "PARM":
                    parameters[row.Name] = float(row.Value)
                    continue
                instance = row.fmt.instance_field
                table = tables[row.get_type() if instance is None else f"{row.get_type()}{getattr(row, instance)}"]
                for column, value in row.to_dict().items():
                    table[column].append(value)
    except OSError as error:
        raise DataFlashError(f"{path}: {error.strerror}") from error
    except (ValueError, LookupError, TypeError) as error:  # of pymavlink for an invalid file
        raise DataFlashError(f"{path} is not a DataFlash log") from error
    return tables, parameters
