"""Forwarding between channels: https://mavlink.io/en/guide/routing.html.

A broadcast goes to every channel, a message with a target to channels that have received the target; but never to a
channel that has received its source. So messages cannot circulate.
"""

Source = tuple[int, int]  # system and component id

SOURCES = 64  # limit of sources remembered per channel; the oldest is forgotten


class Router:
    """Table of the sources received on each channel."""

    def __init__(self, own: Source) -> None:
        self._own = own
        self._sources: dict[int, dict[Source, None]] = {}

    def open(self, channel: int) -> None:
        self._sources[channel] = {}

    def close(self, channel: int) -> None:
        self._sources.pop(channel, None)

    def receive(self, source: Source, channel: int) -> None:
        sources = self._sources[channel]
        if source in sources:
            return
        if len(sources) == SOURCES:
            del sources[next(iter(sources))]
        sources[source] = None

    def onward(self, source: Source, target: Source, channel: int) -> list[int]:
        """Return the channels to forward a message to; target ids of 0 mean all."""
        if target == self._own:
            return []
        return [
            other
            for other, sources in self._sources.items()
            if other != channel and source not in sources and (not target[0] or _leads_to(target, sources))
        ]

    def concerns_us(self, target: Source) -> bool:
        system, component = target
        return system in (0, self._own[0]) and component in (0, self._own[1])


def _leads_to(target: Source, sources: dict[Source, None]) -> bool:
    system, component = target
    if component:
        return target in sources
    return any(system == other for other, _ in sources)


def target_of(fields: object) -> Source:
    """Return the target's system and component id, 0 for all."""
    system = getattr(fields, "target_system", None)
    if system is None:
        return getattr(fields, "target", 0), 0
    return system, getattr(fields, "target_component", 0)
