import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.core.step import Received
from colibri.autopilot.process import logs
from colibri.autopilot.process.logs import AutopilotLog
from colibri.autopilot.process.recorded_inputs import Setup
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.process.log_files import LogError
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.services.statustext import ERROR, WARNING
from colibri.mavlink.ulog.log import TopicLog
from colibri.plant.vehicle.description import load_vehicle

SETUP = Setup(
    profile="flight",
    controller="lpv-mpc",
    solver=None,
    vehicle="hummingbird",
    feedback=Feedback.STATE,
    track=None,
    origin=DEFAULT_ORIGIN,
    system_id=1,
    identity="px4",
    ground=True,
    profile_tables=load_profile("flight"),
    vehicle_tables=load_vehicle("hummingbird"),
)


class Sizes(TopicLog):
    def __init__(self) -> None:
        super().__init__(self._append)
        self.size = 0
        self.last = b""

    def _append(self, encoded: bytes) -> None:
        self.size += len(encoded)
        self.last = encoded


def test_a_flood_of_stations_is_recorded_up_to_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logs, "MAX_RECEIVED_BYTES", 50_000)
    topics = Sizes()
    log = AutopilotLog(topics, SETUP)
    said: list[str] = []
    handled = 0
    for _ in range(100):
        try:
            for _ in log.recorded([Received(bytes(280), 0, ("127.0.0.1", 5))] * 10):
                handled += 1
        except LogError as error:
            said.append(str(error))
    assert (handled, len(said)) == (1000, 1)
    assert topics.size < 51_000
    assert b"no more is recorded" in topics.last


def test_a_flood_of_texts_leaves_errors_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logs, "MAX_SAID_BYTES", 5_000)
    topics = Sizes()
    log = AutopilotLog(topics, SETUP)
    for _ in range(1000):
        log.say(0, WARNING, "denied: not armed")
    assert topics.size < 5_200
    assert b"only errors" in topics.last
    log.say(0, ERROR, "the battery is empty")
    assert b"the battery is empty" in topics.last
