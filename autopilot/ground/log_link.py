"""The flight log as a link of the hub: telemetry is streamed to it while the rotors are armed."""

from colibri.mavlink.files.flight_log import FlightLog
from colibri.mavlink.files.tree import Files
from colibri.mavlink.node.hub import Hub, Outgoing
from colibri.mavlink.streaming.rates import SDK, SILENT
from colibri.mavlink.streaming.service import StreamService
from colibri.mavlink.wire.framing import Framer

LOGS = "logs"
LOG_LINK = -1
"""Number of the link."""


class LogLink:
    """Records what one hub sends on the log's link."""

    def __init__(self, hub: Hub, streams: StreamService, files: Files, boot_unix_us: int = 0) -> None:
        """Open the link; logs go to folder `logs` of `files`, dated from Unix time `boot_unix_us` at the start on."""
        self._boot_unix_us = boot_unix_us
        self._streams = streams
        self._log = FlightLog(files, (LOGS,))
        self._framer = Framer()
        self._channel = hub.open(LOG_LINK, None)
        self._streams.use(self._channel, SILENT)
        self._armed = False

    @property
    def name(self) -> str | None:
        """Name of the log that is being written."""
        return self._log.name

    def update(self, *, armed: bool) -> None:
        """Stream telemetry to the log while the rotors are armed."""
        if armed is not self._armed:
            self._armed = armed
            self._streams.use(self._channel, SDK if armed else SILENT)

    def record(self, outbox: list[Outgoing], now_us: int, *, armed: bool) -> list[Outgoing]:
        """Record the datagrams of the log's link; return those of the others."""
        self._log.update(armed, now_us)
        others = without_log(outbox)
        if len(others) < len(outbox):
            for outgoing in outbox:
                if outgoing.link == LOG_LINK:
                    self._log.record(self._boot_unix_us + now_us, self._framer.take(outgoing.datagram))
        return others

    def close(self) -> None:
        """Close the log."""
        self._log.close()


def without_log(outbox: list[Outgoing]) -> list[Outgoing]:
    """Return the datagrams of all links but the log's."""
    return [outgoing for outgoing in outbox if outgoing.link != LOG_LINK]
