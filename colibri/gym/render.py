"""Pictures of an episode: an array of pixels, or the page of `colibri view`."""

import subprocess
import sys
from contextlib import suppress
from time import perf_counter, sleep
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from colibri.common.rotations import earth_from_body, rotation_matrix
from colibri.common.types import Array
from colibri.gym.episodes import Episodes
from colibri.mavlink.links.open import open_link
from colibri.mavlink.wire.dialect import Codec, mav
from colibri.mavlink.wire.ned import frd_from_flu, ned_frd_from_enu_flu, ned_from_enu

_TRAIL, _LARGER = 500, 3.0  # positions drawn behind the vehicle, and its size in parts of the real one
_HEARTBEAT_S = 1.0


class Picture:
    """Draws reference or gates, path and vehicle, 640 by 480 pixels."""

    def __init__(self, episodes: Episodes) -> None:
        self._episodes = episodes
        self._canvas: Any = FigureCanvasAgg(Figure(figsize=(6.4, 4.8), dpi=100))
        self._axes: Any = self._canvas.figure.add_subplot(projection="3d")
        (self._reference,) = self._axes.plot([], [], [], "o" if episodes.gate_m else "-", color="0.6", lw=1)
        (self._path,) = self._axes.plot([], [], [], color="C0", lw=1)
        (self._arms,) = self._axes.plot([], [], [], color="k", lw=2)
        self._trail: list[Array] = []
        ends = _LARGER * episodes.vehicle.arms_m()
        self._star = np.vstack([part for end in ends for part in (np.zeros(3), end, np.full(3, np.nan))])

    def begin(self) -> None:
        points = self._episodes.reference[:, :3]
        self._reference.set_data_3d(*points.T)
        shown = np.vstack([points, self._episodes.x[0, 6:9]])
        low, high = shown.min(axis=0) - 1.0, shown.max(axis=0) + 1.0
        self._axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(max(low[2], 0.0), high[2]))
        self._axes.set(xlabel="east, m", ylabel="north, m", zlabel="up, m")
        self._axes.set_aspect("equal", adjustable="datalim")
        self._trail.clear()
        self.step()

    def step(self) -> None:
        self._trail.append(self._episodes.x[0, 6:9].copy())
        del self._trail[:-_TRAIL]

    def draw(self) -> NDArray[np.uint8]:
        """Return the picture, (480, 640, 3)."""
        x, y, z = self._trail[-1]
        qw, qx, qy, qz = self._episodes.x[0, 9:13].tolist()
        self._path.set_data_3d(*np.array(self._trail).T)
        self._arms.set_data_3d(*(self._star @ np.array(rotation_matrix((qw, qx, qy, qz))).T + (x, y, z)).T)
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def close(self) -> None: ...


class LivePage:
    """Shows an episode in a browser, at most at real time."""

    def __init__(self, episodes: Episodes) -> None:
        self._episodes, self._codec = episodes, Codec(1, 1)
        with_port = open_link("udpin:127.0.0.1:0")
        link = with_port.url
        with_port.close()
        self._page = subprocess.Popen([sys.executable, "-m", "colibri", "view", link])
        self._link = open_link(link.replace("udpin", "udpout"))
        self._shown_s, self._told_s, self._steps = 0.0, -_HEARTBEAT_S, 0

    def begin(self) -> None:
        self.step()

    def step(self) -> None:
        wait_s = self._shown_s + self._episodes.interval_s - perf_counter()
        if wait_s > 0.0:
            sleep(wait_s)
        now_s = self._shown_s = perf_counter()
        self._steps += 1
        ms = round(self._steps * self._episodes.interval_s * 1e3)
        u, v, w, p, q, r, x, y, z, qw, qx, qy, qz = self._episodes.x[0, :13].tolist()
        place, velocity = ned_from_enu((x, y, z)), ned_from_enu(earth_from_body((qw, qx, qy, qz), (u, v, w)))
        east, north, up = self._episodes.reference[self._episodes.at[0], :3].tolist()
        target = (*ned_from_enu((east, north, up)), *(0.0,) * 8)
        if now_s >= self._told_s + _HEARTBEAT_S:
            self._told_s = now_s
            self._send("HEARTBEAT", mav.MAV_TYPE_QUADROTOR, mav.MAV_AUTOPILOT_PX4, 128, 0, mav.MAV_STATE_ACTIVE, 3)
        attitude = ned_frd_from_enu_flu((qw, qx, qy, qz))
        self._send("ATTITUDE_QUATERNION", ms, *attitude, *frd_from_flu((p, q, r)))
        self._send("POSITION_TARGET_LOCAL_NED", ms, mav.MAV_FRAME_LOCAL_NED, 0x0DF8, *target)
        self._send("LOCAL_POSITION_NED", ms, *place, *velocity)

    def draw(self) -> None: ...

    def close(self) -> None:
        self._link.close()
        self._page.terminate()
        with suppress(subprocess.TimeoutExpired):
            self._page.wait(5.0)

    def _send(self, name: str, *fields: Any) -> None:
        self._link.send(self._codec.encode(name, *fields))
