"""Where a flight begins in a process."""

from colibri.common.process.lifecycle import nudge_m
from colibri.plant.physics.start import Start


def nudged(start: Start) -> Start:
    return start._replace(x=start.x + nudge_m(), y=start.y + nudge_m())
