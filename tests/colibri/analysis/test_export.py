"""`colibri export`: what is written has each number of the ULog, by the readers of its formats."""

import csv
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from pyarrow.parquet import read_table
from pyulog import ULog
from scipy.io import loadmat

import colibri
from colibri.cli.main import main
from colibri.mavlink.ulog.flight_topics import COMMAND, DECISION, ESTIMATE, FLIGHT_TOPICS, TRUTH
from colibri.mavlink.ulog.reader import FlightFile
from tests.support.commands import Refused

FLIGHT = ["fly", "spiral", "--quiet", "--no-figures", "--duration", "2", "--feedback", "sensors", "--link", "memory"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("flight")
    assert main([*FLIGHT, "--out", str(out)]) == 0
    assert main(["export", str(out), "--mcap", "--csv", "--mat", "--parquet", "--quiet"]) == 0
    return out


@pytest.fixture(scope="module")
def log(folder: Path) -> ULog:
    return ULog(str(folder / "flight.ulg"))


def flat(value: Any, name: str) -> dict[str, Any]:
    if isinstance(value, dict):
        inner = [flat(part, f"{name}.{key}" if name else key) for key, part in value.items()]
    elif isinstance(value, list):
        inner = [flat(part, f"{name}[{place}]") for place, part in enumerate(value)]
    else:
        return {name: value}
    return {key: part for each in inner for key, part in each.items()}


def known(number: float) -> float | None:
    return number if number == number else None


def test_each_message_of_the_mcap_is_a_row_of_its_topic(folder: Path, log: ULog) -> None:
    found: dict[str, list[dict[str, Any]]] = {}
    times_us = []
    with (folder / "flight.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None
            content = json.loads(message.data)
            assert content.keys() == json.loads(schema.data)["properties"].keys()
            if channel.topic == "logged_messages":
                assert (schema.name, content["message"]) == ("foxglove.Log", "spiral, profile flight, lpv-mpc")
                continue
            assert message.log_time == 1000 * content["timestamp"]
            found.setdefault(channel.topic, []).append(flat(content, ""))
            times_us.append(message.log_time)
    assert times_us == sorted(times_us)
    assert found.keys() == {topic.name for topic in log.data_list}
    for topic in log.data_list:
        rows = zip(*(map(known, column.tolist()) for column in topic.data.values()), strict=True)
        assert found[topic.name] == [dict(zip(topic.data, row, strict=True)) for row in rows]


def test_the_mcap_has_the_parameters(folder: Path, log: ULog) -> None:
    with (folder / "flight.mcap").open("rb") as file:
        (metadata,) = make_reader(file).iter_metadata()
    assert metadata.metadata == {name: str(value) for name, value in log.initial_parameters.items()}


def test_each_topic_is_a_table(folder: Path, log: ULog) -> None:
    tables = folder / "flight-topics"
    assert len(list(tables.iterdir())) == 2 * len(log.data_list)
    own = {topic.name: topic for topic in FLIGHT_TOPICS}
    for topic in log.data_list:
        if topic.name in own:
            continue
        with (tables / f"{topic.name}.csv").open(encoding="utf-8") as file:
            names, *rows = csv.reader(file)
        assert names == list(topic.data)
        parquet = read_table(tables / f"{topic.name}.parquet")
        for place, (name, column) in enumerate(topic.data.items()):
            assert [row[place] for row in rows] == list(map(str, column.tolist()))
            assert str(parquet[name].to_pylist()) == str(column.tolist())


def test_own_topics_are_tables_with_every_bit(folder: Path) -> None:
    log = FlightFile(folder / "flight.ulg")
    for topic in (TRUTH, DECISION, COMMAND, ESTIMATE):
        with (folder / "flight-topics" / topic.table).open(encoding="utf-8") as file:
            names, *rows = csv.reader(file)
        assert tuple(names) == topic.names
        read = np.array([list(map(float, row)) for row in rows])
        assert read.tobytes() == np.concatenate(list(log.blocks(topic))).tobytes()


def test_each_topic_is_a_struct_of_the_mat_file(folder: Path, log: ULog) -> None:
    structs = loadmat(folder / "flight.mat", simplify_cells=True)
    own = {topic.name: topic for topic in FLIGHT_TOPICS}
    flight = FlightFile(folder / "flight.ulg")
    for topic in log.data_list:
        if topic.name in own:
            mine = own[topic.name]
            columns = structs[mine.table.removesuffix(".csv")]
            assert tuple(columns) == mine.names
            rows = np.concatenate(list(flight.blocks(mine)))
            assert np.stack(list(columns.values()), axis=1).tobytes() == rows.tobytes()
        else:
            columns = structs[topic.name]
            assert all(name.isidentifier() and len(name) < 64 for name in columns)
            for column, logged in zip(columns.values(), topic.data.values(), strict=True):
                np.testing.assert_array_equal(np.atleast_1d(column), logged)


def test_the_table_of_the_filter_has_what_the_vehicle_measures(tmp_path: Path) -> None:
    colibri.fly("hover", feedback="sensors", duration=1.5).save(tmp_path / "flight")
    assert main(["export", str(tmp_path / "flight"), "--csv", "--quiet"]) == 0
    names, *_ = (tmp_path / "flight" / "flight-topics" / "filter.csv").read_text(encoding="utf-8").splitlines()
    kinds = [name.removeprefix("nis_") for name in names.split(",") if name.startswith("nis_")]
    assert kinds == ["velocity", "position", "height", "pressure", "field"]


@pytest.mark.parametrize(
    ("content", "options", "said"),
    [
        (b"", [], "choose a format: --mcap, --csv, --mat, --parquet, or several of them"),
        (b"no log", ["--csv"], "is not a ULog"),
        (None, ["--csv"], "No such file or directory"),
    ],
)
def test_what_cannot_be_exported_is_said_in_a_line(
    content: bytes | None, options: list[str], said: str, tmp_path: Path, refused: Refused
) -> None:
    if content is not None:
        (tmp_path / "flight.ulg").write_bytes(content)
    assert said in refused("export", tmp_path, *options)


@pytest.mark.parametrize(
    ("module", "option", "extra"),
    [("pyulog", "--csv", "export"), ("mcap.writer", "--mcap", "export"), ("pyarrow", "--parquet", "parquet")],
)
def test_where_a_library_is_missing_it_is_said_how_to_get_it(
    module: str, option: str, extra: str, folder: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    assert f"pip install 'colibri-sitl[{extra}]'" in refused("export", folder, option)
