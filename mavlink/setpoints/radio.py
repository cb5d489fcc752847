"""A radio's channels, which clients override as in ArduPilot.

Of RC_CHANNELS_OVERRIDE (70), 0 releases a channel, 65535 leaves it; an override lapses after RC_OVERRIDE_TIME, and only
the ground station of SYSID_MYGCS is obeyed. MANUAL_CONTROL (69) overrides channels 1 to 4.
"""

from collections.abc import Mapping
from typing import Any, Protocol

from colibri.mavlink.node.service import Peer
from colibri.mavlink.services.statustext import StatusText
from colibri.mavlink.setpoints.arbitration import Refused
from colibri.mavlink.setpoints.manual_control import (
    MAX_US,
    MIDDLE_US,
    MIN_US,
    RELEASED,
    UNCHANGED,
    Channels,
    Controls,
    Manual,
    sticks_of,
)
from colibri.mavlink.setpoints.setpoints import Sticks

CHANNELS = 18
_FIRST_EXTENDED = 9
_RELEASED_EXTENDED = 65534  # of channels 9 to 18, whose 0 leaves them
FAILED, THROTTLE_LOW = 1, 2  # SIM_RC_FAIL: no signal; all channels centred, and the throttle at `LOW_US`
LOW_US = 950


class RadioSettings(Protocol):
    def __getitem__(self, name: str, /) -> float: ...


class Radio(Manual):
    """Keeps the channels of one radio; `fails` is SIM_RC_FAIL."""

    def __init__(self, system_id: int, text: StatusText, transmitter: tuple[int, ...], settings: RadioSettings) -> None:
        """`transmitter` has the channels without overrides, us; `settings` are parameters by name."""
        super().__init__(system_id, text)
        self.transmitter, self._settings = transmitter, settings
        self._overrides: dict[int, int] = {}
        self._overridden_us = 0

    def _decode(self, message: Any, peer: Peer, now_us: int) -> Controls | None:
        if peer.system != self._settings["SYSID_MYGCS"]:
            raise Refused("another ground station")
        if message.name != "RC_CHANNELS_OVERRIDE":
            controls = super()._decode(message, peer, now_us)
            if controls is not None:
                self._override(dict(enumerate(_pulses(controls.sticks), start=1)), now_us)
            return controls
        fields = message.fields
        given = [getattr(fields, f"chan{number}_raw", 0) for number in range(1, CHANNELS + 1)]
        changes: dict[int, int] = {}
        for number, value in enumerate(given, start=1):
            extended = number >= _FIRST_EXTENDED
            if value != UNCHANGED and not (extended and value == RELEASED):
                changes[number] = RELEASED if extended and value == _RELEASED_EXTENDED else value
        self._override(changes, now_us)
        return None

    def _override(self, changes: Mapping[int, int], now_us: int) -> None:
        self._overridden_us = now_us
        for number, value in changes.items():
            if value == RELEASED:
                self._overrides.pop(number, None)
            else:
                self._overrides[number] = value

    def channels(self, now_us: int) -> tuple[int, ...]:
        """Return the channels, us; empty without a signal."""
        settings = self._settings
        lapse_s, fails = settings["RC_OVERRIDE_TIME"], settings["SIM_RC_FAIL"]
        if self._overrides and 0.0 <= lapse_s < (now_us - self._overridden_us) * 1e-6:
            self._overrides.clear()
        if fails == FAILED and not self._overrides:
            return ()
        values = list(self.transmitter)
        if fails:
            values = [MIDDLE_US] * len(values)
            values[2] = LOW_US
        values += [0] * (max(self._overrides, default=0) - len(values))
        for number, value in self._overrides.items():
            values[number - 1] = value
        return tuple(values)

    def latest(self, now_us: int, timeout_us: int) -> Sticks | None:
        del timeout_us  # a radio is received or not
        self.held = channels = self.channels(now_us)
        if not channels or (self._settings["FS_THR_ENABLE"] and channels[2] < self._settings["FS_THR_VALUE"]):
            return None
        return sticks_of(channels, now_us)


def _pulses(sticks: Sticks) -> Channels:
    half = (MAX_US - MIN_US) // 2
    return (
        round(MIDDLE_US + half * sticks.roll),
        round(MIDDLE_US - half * sticks.pitch),
        round(MIN_US + 2 * half * sticks.thrust),
        round(MIDDLE_US + half * sticks.yaw),
    )
