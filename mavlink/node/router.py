"""Which channels a message of somebody else's goes on to: https://mavlink.io/en/guide/routing.html.

A broadcast goes to every channel, a message with a target only to where the target has been heard. Neither goes to a
channel on which its source has been heard: that has it already. So nothing can run in circles, even where two channels
lead to the same place.
"""

Source = tuple[int, int]
"""System and component id."""

SOURCES = 64
"""Sources remembered per channel; of more, the one heard first is forgotten."""


class Router:
    """Remembers who was heard on which channel."""

    def __init__(self, own: Source) -> None:
        """Route for everybody but `own`, which nothing is forwarded to."""
        self._own = own
        self._heard: dict[int, dict[Source, None]] = {}

    def open(self, channel: int) -> None:
        """Forward to `channel` from now on."""
        self._heard[channel] = {}

    def close(self, channel: int) -> None:
        """Forget `channel`."""
        self._heard.pop(channel, None)

    def hear(self, source: Source, channel: int) -> None:
        """Remember that `source` can be reached on `channel`."""
        heard = self._heard[channel]
        if source in heard:
            return
        if len(heard) == SOURCES:
            del heard[next(iter(heard))]
        heard[source] = None

    def onward(self, source: Source, target: Source, channel: int) -> list[int]:
        """Return the channels to forward a message to that came on `channel`; target ids of 0 mean all."""
        if target == self._own:
            return []
        return [
            other
            for other, heard in self._heard.items()
            if other != channel and source not in heard and (not target[0] or _leads_to(target, heard))
        ]

    def concerns_us(self, target: Source) -> bool:
        """Whether a message is for us, or for all."""
        system, component = target
        return system in (0, self._own[0]) and component in (0, self._own[1])


def _leads_to(target: Source, heard: dict[Source, None]) -> bool:
    system, component = target
    if component:
        return target in heard
    return any(system == other for other, _ in heard)


def target_of(fields: object) -> Source:
    """Return whom a message is for, 0 where it does not say.

    MANUAL_CONTROL alone says it otherwise: its `target` is a system.
    """
    system = getattr(fields, "target_system", None)
    if system is None:
        return getattr(fields, "target", 0), 0
    return system, getattr(fields, "target_component", 0)
