"""Export a ULog as a MAT file, for MATLAB and Octave: a struct of columns for each topic."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from colibri.analysis.export import topics_of
from colibri.mavlink.ulog.flight_topics import FLIGHT_TOPICS
from colibri.mavlink.ulog.reader import FlightFile, LogFormatError

if TYPE_CHECKING:
    from pyulog import ULog

_MOST_LETTERS = 63
"""Of a name in MATLAB."""


def write_mat(log: "ULog", path: Path, to: Path) -> Path:
    """Write the log read from `path`: Colibri's own topics by the names of their tables, `t` in s; others as logged."""
    from scipy.io import savemat  # slow to load

    own = {topic.name for topic in FLIGHT_TOPICS}
    topics: dict[str, Any] = {}
    try:
        flight = FlightFile(path)
    except LogFormatError:
        own = set()
    else:
        for topic in FLIGHT_TOPICS:
            if blocks := list(flight.blocks(topic)):
                columns = np.concatenate(blocks).T
                topics[topic.table.removesuffix(".csv")] = dict(zip(topic.names, columns, strict=True))
    for name, logged, _ in topics_of(log):
        if name not in own:
            topics[_name(name)] = {_name(column): values for column, values in logged.data.items()}
    savemat(to, topics, long_field_names=True, do_compression=True, oned_as="column")
    return to


def _name(given: str) -> str:
    """Return a name that MATLAB allows: `esc[0].esc_rpm` is `esc_0_esc_rpm`."""
    name = re.sub(r"\W+", "_", given).strip("_")
    return (name if name[:1].isalpha() else f"x{name}")[:_MOST_LETTERS]
