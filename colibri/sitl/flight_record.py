"""The record of a flight, with all STATUSTEXT messages sent."""

import csv
from collections.abc import Sequence
from hashlib import sha256
from math import inf
from pathlib import Path
from struct import Struct
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.commander.rules.modes import mode_of_custom
from colibri.common.process.writable_folders import use_writable_folders
from colibri.mavlink.client.inbox import Inbox
from colibri.mavlink.wire.dialect import Codec, mav
from colibri.mavlink.wire.framing import Framer
from colibri.mavlink.wire.tlog import TlogWriter
from colibri.sitl.backends.link_faults import Instant

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
KEPT = ("plant.tlog", "ground.tlog", "flight.csv", "flight.png", "flight.json")  # files of a flight
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
    names = (*_STATE, *(f"control{number}" for number in range(1, rotors + 1)), "armed", "custom_mode")
    return names, Struct(f"<{len(names)}d"), Struct(f"<Q13d{rotors}d?")


def mode_name(number: float) -> str:
    return str(mode_of_custom(int(number)) or int(number))


def tilt_deg(flown: Columns) -> NDArray[np.float64]:
    upright = 1.0 - 2.0 * (flown["qx"] ** 2 + flown["qy"] ** 2)
    return np.asarray(np.degrees(np.arccos(np.clip(upright, -1.0, 1.0))))


_MAX_TEXTS = 18  # lines that fit below the view from above; the last ones are shown
_ROOM_FOR_LEGEND = 0.15
_END_COLOUR = "tab:red"


def draw(
    flown: Columns, texts: Sequence[tuple[float, str]], path: Path, *, failed_s: float, title: str, reason: str
) -> None:
    """Draw a flight that failed at `failed_s`; `texts` have times in s."""
    use_writable_folders()
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14.0, 8.5), layout="constrained")
    figure.suptitle("\n".join(filter(None, (_line(title, 130), _line(reason, 130)))), fontsize=11)
    axes = figure.subplot_mosaic(
        [["place", "plan"], ["tilt", "texts"], ["mode", "texts"]], height_ratios=(4, 2, 2), width_ratios=(3, 2)
    )
    for name in ("place", "tilt"):
        axes[name].sharex(axes["mode"])
        axes[name].tick_params(labelbottom=False)
    _draw_place(axes["place"], flown, failed_s)
    axes["tilt"].plot(flown["t"], tilt_deg(flown))
    axes["tilt"].set_ylabel("tilt, degrees")
    _draw_modes(axes["mode"], flown)
    _draw_plan(axes["plan"], flown)
    numbered = list(enumerate(texts, 1))[-_MAX_TEXTS:]
    for name in ("place", "tilt", "mode"):
        for _, (time_s, _text) in numbered:
            axes[name].axvline(time_s, color="0.7", linewidth=0.8, linestyle=":")
        axes[name].axvline(failed_s, color=_END_COLOUR)
    _write_texts(axes["texts"], axes["place"], numbered)
    figure.savefig(path, dpi=100)


def _draw_place(axes: "Axes", flown: Columns, failed_s: float) -> None:
    for name, label, width_pt in (("x", "east", 4.0), ("y", "north", 2.4), ("z", "up", 1.2)):
        axes.plot(flown["t"], flown[name], label=label, linewidth=width_pt)
    axes.set_ylabel("position, m")
    bottom, top = axes.get_ylim()
    axes.set_ylim(bottom, top + _ROOM_FOR_LEGEND * (top - bottom))
    axes.legend(loc="upper left", ncols=3)
    axes.text(
        *(failed_s, 1.06, f"failed at {failed_s:.3f} s"),
        transform=axes.get_xaxis_transform(),
        ha="right",
        va="bottom",
        color=_END_COLOUR,
    )


def _draw_modes(axes: "Axes", flown: Columns) -> None:
    numbers, which = np.unique(flown["custom_mode"], return_inverse=True)
    axes.step(flown["t"], which, where="post")
    armed = flown["armed"] > 0.0
    axes.fill_between(flown["t"], -0.5, len(numbers) - 0.5, where=armed, alpha=0.15, label="armed")
    axes.set_yticks(range(len(numbers)), [mode_name(number) for number in numbers])
    axes.legend(loc="upper left")
    axes.set_xlabel("simulated time, s")


def _draw_plan(axes: "Axes", flown: Columns) -> None:
    east, north = flown["x"], flown["y"]
    axes.plot(east, north)
    axes.plot(east[0], north[0], "o", color="tab:green", label="begin")
    axes.plot(east[-1], north[-1], "X", markersize=9, label="failed", color=_END_COLOUR)
    half_m = 0.55 * max(float(np.ptp(east)), float(np.ptp(north)), 2.0)
    for set_limits, along in ((axes.set_xlim, east), (axes.set_ylim, north)):
        middle = 0.5 * (float(along.min()) + float(along.max()))
        set_limits(middle - half_m, middle + half_m)
    axes.set_aspect("equal")
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    axes.legend(loc="upper left")
    axes.set_title("from above", fontsize=10)


def _write_texts(axes: "Axes", timeline: "Axes", numbered: Sequence[tuple[int, tuple[float, str]]]) -> None:
    axes.axis("off")
    lines = [f"{number:>3}  {time_s:8.3f} s  {_line(text, 54)}" for number, (time_s, text) in numbered]
    axes.text(0.0, 1.0, "\n".join(lines or ["no texts"]), va="top", family="monospace", fontsize=8.5)
    shown_s, room_s = -inf, 0.02 * float(np.diff(timeline.get_xlim())[0])
    for number, (time_s, _) in numbered:
        if time_s > shown_s + room_s:  # of several at a time, the first number
            shown_s = time_s
            over = timeline.get_xaxis_transform()
            timeline.text(time_s, 1.01, str(number), transform=over, ha="center", va="bottom", fontsize=8)


def _line(text: str, width: int) -> str:
    line = " ".join(text.split())
    return (line if len(line) <= width else f"{line[: width - 1]}…").replace("$", r"\$")
