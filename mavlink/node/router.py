"""Which channels a message of somebody else's goes on to: https://mavlink.io/en/guide/routing.html.

A broadcast goes to every channel, a message with a target only to channels on which the target was received.
Neither goes to a channel on which its source was received: that has it already. So nothing can run in circles, even
where two channels lead to the same place.
"""

Source = tuple[int, int]
"""System and component id."""

SOURCES = 64
"""Sources remembered per channel; of more, the first is forgotten."""


class Router:
    """Table of the sources received on each channel."""

    def __init__(self, own: Source) -> None:
        """Route for everybody but `own`, which nothing is forwarded to."""
        self._own = own
        self._sources: dict[int, dict[Source, None]] = {}

    def open(self, channel: int) -> None:
        """Forward to `channel` from now on."""
        self._sources[channel] = {}

    def close(self, channel: int) -> None:
        """Forget `channel`."""
        self._sources.pop(channel, None)

    def receive(self, source: Source, channel: int) -> None:
        """Note that `source` can be reached on `channel`."""
        sources = self._sources[channel]
        if source in sources:
            return
        if len(sources) == SOURCES:
            del sources[next(iter(sources))]
        sources[source] = None

    def onward(self, source: Source, target: Source, channel: int) -> list[int]:
        """Return the channels to forward a message to that came on `channel`; target ids of 0 mean all."""
        if target == self._own:
            return []
        return [
            other
            for other, sources in self._sources.items()
            if other != channel and source not in sources and (not target[0] or _leads_to(target, sources))
        ]

    def concerns_us(self, target: Source) -> bool:
        """Whether a message is for us, or for all."""
        system, component = target
        return system in (0, self._own[0]) and component in (0, self._own[1])


def _leads_to(target: Source, sources: dict[Source, None]) -> bool:
    system, component = target
    if component:
        return target in sources
    return any(system == other for other, _ in sources)


def target_of(fields: object) -> Source:
    """Return system and component id of a message's target, 0 for all.

    MANUAL_CONTROL alone has another field for it, `target`, a system id.
    """
    system = getattr(fields, "target_system", None)
    if system is None:
        return getattr(fields, "target", 0), 0
    return system, getattr(fields, "target_component", 0)
