"""Forwarding between channels: https://mavlink.io/en/guide/routing.html.

A broadcast goes to every channel, a message with a target to channels that have received the target; but never to a
channel that has received its source. So messages cannot circulate.
"""

from collections.abc import Collection, Mapping

Source = tuple[int, int]  # system and component id


def onward(received: Mapping[int, Collection[Source]], source: Source, target: Source, channel: int) -> list[int]:
    """Return the channels to forward a message to, by the sources that each has received."""
    return [
        other
        for other, sources in received.items()
        if other != channel and source not in sources and (not target[0] or _leads_to(target, sources))
    ]


def concerns(own: Source, target: Source) -> bool:
    return target[0] in (0, own[0]) and target[1] in (0, own[1])


def _leads_to(target: Source, sources: Collection[Source]) -> bool:
    system, component = target
    return target in sources if component else any(system == other for other, _ in sources)


def target_of(fields: object) -> Source:
    """Return the target's system and component id, 0 for all."""
    system = getattr(fields, "target_system", None)
    if system is None:
        return getattr(fields, "target", 0), 0
    return system, getattr(fields, "target_component", 0)
