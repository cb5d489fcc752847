"""The beginning of a ULog file: formats of all topics, facts, parameters, subscriptions."""

from collections.abc import Mapping
from importlib.metadata import version as version_of_package

from colibri.mavlink.ulog import messages
from colibri.mavlink.ulog.flight_topics import FLIGHT_TOPICS
from colibri.mavlink.ulog.inputs import INPUT, INPUT_FIELDS, INPUT_NUMBER
from colibri.mavlink.ulog.topics import NUMBERS, PARTS, TOPICS


def beginning(vehicle: str, parameters: Mapping[str, int | float]) -> bytes:
    own = {topic.name: topic.fields for topic in FLIGHT_TOPICS} | {INPUT: INPUT_FIELDS}
    numbers = NUMBERS | {topic.name: topic.number for topic in FLIGHT_TOPICS} | {INPUT: INPUT_NUMBER}
    formats = [messages.format_of(name, fields) for name, fields in {**PARTS, **TOPICS, **own}.items()]
    facts = {"sys_name": "Colibri", "ver_hw": vehicle, "ver_sw": version_of_package("colibri-sitl")}
    known = messages.information(facts) + messages.parameters(parameters)
    subscriptions = [messages.subscription(name, number) for name, number in numbers.items()]
    return b"".join([messages.header(), *formats, known, *subscriptions])
