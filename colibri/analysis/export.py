"""Export a ULog as MCAP, as MAT file, or as a table of each topic."""

import csv
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from heapq import merge
from io import BufferedReader, FileIO, StringIO
from itertools import chain
from os import fstat
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from colibri.analysis.logs import csv_rows
from colibri.common.errors import Error
from colibri.common.files import regular
from colibri.mavlink.ulog.flight_topics import FILTER, FLIGHT_TOPICS
from colibri.mavlink.ulog.reader import FILE, FlightFile, LogFormatError

if TYPE_CHECKING:
    from pyulog import ULog

_NS_PER_US = 1000
_MOST_READS = 10_000
_LOG_SCHEMA = {
    "type": "object",
    "properties": {
        "timestamp": {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}},
        **{name: {"type": "integer"} for name in ("level", "line")},
        **{name: {"type": "string"} for name in ("message", "name", "file")},
    },
}
"""Schema of `foxglove.Log`, a panel of Foxglove."""
_LEVELS = (5, 5, 5, 4, 3, 2, 2, 1)  # Foxglove's level of each severity of a status text


class ExportError(Error):
    """A log cannot be exported."""


class _Bounded(BufferedReader):
    """A file with fewer reads than bytes: pyulog would read a damaged end forever."""

    _reads = 0

    def read(self, size: int | None = -1, /) -> bytes:
        self._reads += 1
        if self._reads > _MOST_READS and self._reads > fstat(self.fileno()).st_size:
            raise ExportError("damaged")
        return super().read(size)


def read_log(log: Path) -> "ULog":
    with _needed("pyulog", "export"):
        from pyulog import ULog
    try:
        with FileIO(log, opener=regular) as file, redirect_stdout(StringIO()):  # pyulog prints what is damaged
            return ULog(_Bounded(file))
    except OSError as error:
        raise ExportError(f"{log}: {error.strerror}") from error
    except Exception as error:  # pyulog raises many kinds for an invalid file
        raise ExportError(f"{log} is not a ULog") from error


def write_mcap(log: "ULog", path: Path) -> Path:
    """Write topics as JSON with schemas, status texts as `foxglove.Log`."""
    with _needed("mcap", "export"):
        from mcap.writer import Writer
    with path.open("wb") as file:
        writer: Any = Writer(file)  # partly untyped
        writer.start(library="colibri")
        streams = [_messages(topic, _channel(writer, name, name, schema)) for name, topic, schema in topics_of(log)]
        streams.append(_texts(log, _channel(writer, "logged_messages", "foxglove.Log", _LOG_SCHEMA)))
        for time_us, channel, message in merge(*streams, key=lambda each: each[0]):
            writer.add_message(channel, time_us * _NS_PER_US, msgspec.json.encode(message), time_us * _NS_PER_US)
        writer.add_metadata("parameters", {name: str(value) for name, value in log.initial_parameters.items()})
        writer.finish()
    return path


def log_file(path: Path) -> Path:
    return path / FILE if path.is_dir() else path


def write_flight_tables(path: Path, folder: Path) -> bool:
    """Write Colibri's own topics as tables, if the log has them."""
    try:
        log = FlightFile(path)
    except (OSError, LogFormatError):
        return False
    for topic in FLIGHT_TOPICS:
        blocks = log.blocks(topic)
        first = next(blocks, None)
        if first is None:
            continue
        known = ~np.isnan(first).all(axis=0) if topic is FILTER else np.ones(len(topic.names), np.bool_)
        with _table(folder, topic.table).open("wb") as file:
            file.write((",".join(np.array(topic.names)[known]) + "\n").encode())
            for block in chain([first], blocks):
                file.write(csv_rows(block[:, known]))
    return True


def write_csv(log: "ULog", folder: Path) -> Path:
    """Write a table of each topic but Colibri's own."""
    own = {topic.name for topic in FLIGHT_TOPICS}
    for name, topic, _ in topics_of(log):
        if name in own:
            continue
        with _table(folder, f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(topic.data)
            table.writerows(zip(*(column.tolist() for column in topic.data.values()), strict=True))
    return folder


def write_parquet(log: "ULog", folder: Path) -> Path:
    with _needed("pyarrow", "parquet"):
        from pyarrow import table
        from pyarrow.parquet import write_table
    for name, topic, _ in topics_of(log):
        write_table(table(topic.data), _table(folder, f"{name}.parquet"))
    return folder


@contextmanager
def _needed(module: str, extra: str) -> Iterator[None]:
    try:
        yield
    except ModuleNotFoundError as error:
        raise ExportError(f"this needs {module}: pip install 'colibri-sitl[{extra}]'") from error


def _table(folder: Path, name: str) -> Path:
    folder.mkdir(exist_ok=True)
    return folder / name


def topics_of(log: "ULog") -> Iterator[tuple[str, Any, dict[str, Any]]]:
    for topic in log.data_list:
        name = f"{topic.name}_{topic.multi_id}" if topic.multi_id else topic.name
        yield name, topic, _schema(_tree(topic.data), [column.dtype for column in topic.data.values()])


def _channel(writer: Any, topic: str, name: str, schema: dict[str, Any]) -> int:
    number = writer.register_schema(name, "jsonschema", msgspec.json.encode(schema))
    channel: int = writer.register_channel(topic, "json", number)
    return channel


def _messages(topic: Any, channel: int) -> Iterator[tuple[int, int, Any]]:
    filled = _filled(_tree(topic.data))
    rows = zip(*(column.tolist() for column in topic.data.values()), strict=True)
    for time_us, row in zip(topic.data["timestamp"].tolist(), rows, strict=True):
        yield time_us, channel, filled(row)


def _texts(log: "ULog", channel: int) -> Iterator[tuple[int, int, Any]]:
    for said in sorted(log.logged_messages, key=lambda each: each.timestamp):
        seconds, rest_us = divmod(said.timestamp, 1_000_000)
        time = {"sec": seconds, "nsec": rest_us * _NS_PER_US}
        level = _LEVELS[min(max(said.log_level - ord("0"), 0), len(_LEVELS) - 1)]
        yield (
            said.timestamp,
            channel,
            {"timestamp": time, "level": level, "message": said.message, "name": "vehicle", "file": "", "line": 0},
        )


def _tree(names: dict[str, Any]) -> dict[str, Any]:
    """Return columns such as `esc[0].esc_rpm` as nested objects."""
    tree: dict[str, Any] = {}
    for place, name in enumerate(names):
        *above, last = re.findall(r"[^.\[\]]+", name)
        inner = tree
        for part in above:
            inner = inner.setdefault(part, {})
        inner[last] = place
    return tree


def _filled(tree: Any) -> Callable[[tuple[Any, ...]], Any]:
    if isinstance(tree, int):
        return lambda row: row[tree]
    parts = {name: _filled(part) for name, part in tree.items()}
    if "0" in parts:
        elements = list(parts.values())
        return lambda row: [part(row) for part in elements]
    return lambda row: {name: part(row) for name, part in parts.items()}


def _schema(tree: Any, types: list[np.dtype[Any]]) -> dict[str, Any]:
    if isinstance(tree, int):
        return {"type": "integer" if np.issubdtype(types[tree], np.integer) else "number"}
    if "0" in tree:
        return {"type": "array", "items": _schema(tree["0"], types)}
    return {"type": "object", "properties": {name: _schema(part, types) for name, part in tree.items()}}


_MOST_LETTERS = 63  # of a name in MATLAB


def write_mat(log: "ULog", to: Path) -> Path:
    """Write Colibri's own topics by the names of their tables, others as logged."""
    from scipy.io import savemat  # slow to load

    own = {topic.name: topic.table.removesuffix(".csv") for topic in FLIGHT_TOPICS}
    topics: dict[str, Any] = {}
    for name, logged, _ in topics_of(log):
        if name in own:
            columns = {column: values.astype(float) for column, values in logged.data.items() if column != "timestamp"}
            topics[own[name]] = {"t": logged.data["timestamp"] / 1e6} | columns
        else:
            topics[_name(name)] = {_name(column): values for column, values in logged.data.items()}
    savemat(to, topics, long_field_names=True, do_compression=True, oned_as="column")
    return to


def _name(given: str) -> str:
    """Return a name that MATLAB allows: `esc[0].esc_rpm` is `esc_0_esc_rpm`."""
    name = re.sub(r"\W+", "_", given).strip("_")
    return (name if name[:1].isalpha() else f"x{name}")[:_MOST_LETTERS]
