"""The record of a flight, with all STATUSTEXT messages sent."""

import csv
from hashlib import sha256
from pathlib import Path
from struct import Struct

import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.commander.rules.modes import mode_of_custom
from colibri.mavlink.client.inbox import Inbox
from colibri.mavlink.wire.dialect import Codec, mav
from colibri.mavlink.wire.framing import Framer
from colibri.mavlink.wire.tlog import TlogWriter
from colibri.sitl.backends.lockstep import Instant

_STATUSTEXT = int(mav.MAVLINK_MSG_ID_STATUSTEXT).to_bytes(3, "little")


class StatusTexts(Inbox):
    def __init__(self) -> None:
        super().__init__()
        self._codec = Codec(0, 0)
        self.times_us: list[int] = []

    def add_datagram(self, datagram: bytes, now_us: int) -> None:
        if _STATUSTEXT not in datagram:  # most have none: what costs time is to decode them
            return
        for message in self._codec.decode(datagram):
            if message.name == "STATUSTEXT":
                self.add(message)
                self.times_us += [now_us] * (len(self.texts) - len(self.times_us))


_STATE = ("t", "x", "y", "z", "vx", "vy", "vz", "qw", "qx", "qy", "qz", "p", "q", "r")
KEPT = ("plant.tlog", "ground.tlog", "flight.csv", "flight.png", "flight.json")
"""Files of a flight."""
PLANT_LOG, GROUND_LOG, TABLE, FIGURE, FACTS = KEPT

Columns = dict[str, NDArray[np.float64]]


class Record:
    """The frames and messages of a flight."""

    def __init__(self) -> None:
        self.frames = 0
        self._names, self._row, self._flown = _layout(4)
        self._rows = bytearray()
        self._plant: list[tuple[int, bytes]] = []
        self._ground: list[tuple[int, bytes]] = []
        self._hash = sha256()

    def add(self, instant: Instant) -> None:
        began, command, custom_mode = instant.began, instant.command, instant.to_stations.custom_mode
        place, moves = began.position_enu_m, began.velocity_enu_m_s
        state = (*place, *moves, *began.attitude, *began.rate_flu_rad_s)
        if not self.frames:
            self._names, self._row, self._flown = _layout(len(command.controls))
        self._hash.update(self._flown.pack(began.time_us, *state, *command.controls, command.armed))
        self._rows += self._row.pack(began.time_us * 1e-6, *state, *command.controls, command.armed, custom_mode)
        self._plant.append((began.time_us, instant.frame + instant.answer))
        self.frames += 1

    def note(self, time_us: int, datagram: bytes) -> None:
        self._ground.append((time_us, datagram))

    @property
    def sha256(self) -> str:
        """Hash of truth and command of each frame; the same on all links."""
        return self._hash.hexdigest()

    def columns(self, since_s: float = 0.0) -> Columns:
        """Return truth in SI, ENU and FLU, controls as fractions of the largest speed, and HEARTBEAT's custom mode."""
        table = np.frombuffer(bytes(self._rows), dtype="<f8").reshape(-1, len(self._names))
        return dict(zip(self._names, table[table[:, 0] >= since_s - 1e-9].T, strict=True))

    def keep(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / TABLE).open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow((*self._names[:-1], "mode"))
            table.writerows((*row, mode_name(number)) for *row, number in self._row.iter_unpack(bytes(self._rows)))
        for name, passed in ((PLANT_LOG, self._plant), (GROUND_LOG, self._ground)):
            framer = Framer()
            log = TlogWriter(folder / name)
            for time_us, datagram in passed:
                log.write(time_us, framer.take(datagram))
            log.close()


def _layout(rotors: int) -> tuple[tuple[str, ...], Struct, Struct]:
    """Return names and layout of rows, and the layout of what is hashed."""
    names = (*_STATE, *(f"control{number}" for number in range(1, rotors + 1)), "armed", "custom_mode")
    return names, Struct(f"<{len(names)}d"), Struct(f"<Q13d{rotors}d?")


def mode_name(number: float) -> str:
    return str(mode_of_custom(int(number)) or int(number))


def tilt_deg(flown: Columns) -> NDArray[np.float64]:
    upright = 1.0 - 2.0 * (flown["qx"] ** 2 + flown["qy"] ** 2)
    return np.asarray(np.degrees(np.arccos(np.clip(upright, -1.0, 1.0))))
