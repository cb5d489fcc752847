"""The page: shows vehicles and collects user actions."""

from collections.abc import Callable, Iterator, Sequence
from queue import Empty

import numpy as np
import viser

from colibri.common.types import Vector
from colibri.view.geometry import bounds, ground_point, outline, vehicle_scale
from colibri.view.page.controls import CommandPanels, ControlPanel, Done, Plots, words
from colibri.view.page.scene import SurroundingsScene, VehicleScene, add_ground
from colibri.view.page.server import PageServer, Token, address, stop
from colibri.view.snapshot import Snapshot, Source

_LEFT_PX, _RIGHT_PX = 290.0, 380.0
_LIVE_EXTENT_M, _LIVE_MARGIN = 8.0, 1.2  # half size of the view before a live path is known; margin around its plans


class Page:
    """Shows vehicles; `laid_out` once a browser's panels have changed its aspect."""

    def __init__(self, sources: Sequence[Source], server: PageServer) -> None:
        self._sources = sources
        self._names = [source.name for source in sources]
        self.server = server
        self.url = address(server)
        self.laid_out = False
        gui, scene = server.gui, server.scene
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        around = [source.surroundings for source in sources]
        middle, extent_m = bounds([points for each in around for points in outline(each)])
        live = sources[0].is_live
        self._extent_m = max(extent_m, _LIVE_EXTENT_M if live else 0.0)
        self._ground_m = min(each.ground_m for each in around)
        self._world = scene.add_frame("/world", show_axes=False)
        self._scale = vehicle_scale(self._extent_m, self._sources[0].airframe)
        self._vehicles: list[VehicleScene] = []
        self._around: list[SurroundingsScene] = []
        self._follows = False
        self._look(middle, self._extent_m)
        begin_s, end_s = zip(*(source.span_s for source in self._sources), strict=True)
        self.controls = ControlPanel(gui, None if live else (min(begin_s), max(end_s)), self._scale)
        gui.main_panel.dock_left()
        gui.main_panel.set_width(_LEFT_PX)
        panel = gui.add_panel()
        self._plots = Plots(gui, panel.add_tab("Plots"), self._names, marked=not live)
        self._plots.show([source.charts() for source in self._sources])
        panel.dock_right()
        panel.set_width(_RIGHT_PX)
        self.server.on_client_connect(self._await_layout)

    @property
    def watched(self) -> bool:
        return bool(self.server.get_clients())

    def reveal(self, snapshots: Sequence[Snapshot] = ()) -> None:
        """Draw the scene, with a live vehicle's surroundings in view."""
        if self._vehicles:
            return
        if snapshots and self._sources[0].is_live:
            known = [points for source in self._sources for points in outline(source.surroundings)]
            middle, extent_m = bounds([*known, *(now.trail for now in snapshots)])
            self._look(middle, max(_LIVE_MARGIN * extent_m, _LIVE_EXTENT_M))
        for client in self.server.get_clients().values():  # they may have come before it was known where to look
            client.camera.position = self.server.initial_camera.position
            client.camera.look_at = self.server.initial_camera.look_at
        add_ground(self.server.scene, self._ground_m, self._extent_m)
        self._around = [SurroundingsScene(self.server.scene, number) for number in range(len(self._sources))]
        self._vehicles = self._built()

    def _await_layout(self, client: viser.ClientHandle) -> None:
        aspect = client.camera.aspect

        def note(camera: viser.CameraHandle) -> None:
            self.laid_out = self.laid_out or camera.aspect != aspect

        client.camera.on_update(note)

    def done(self) -> Iterator[Done]:
        """Yield user actions; those about the picture are applied here."""
        while True:
            try:
                done = self.controls.done.get_nowait()
            except Empty:
                return
            if done.what == "scale":
                self._scale = float(done.value)
                self._vehicles = self._built() if self._vehicles else []
            elif done.what == "follow":
                self._follows = bool(done.value)
                self._world.position = (0.0, 0.0, 0.0)
            yield done

    def show(self, snapshots: Sequence[Snapshot]) -> None:
        if not self._vehicles:
            return
        layers = self.controls.layers
        if any(len(now.rotors) != vehicle.rotors for vehicle, now in zip(self._vehicles, snapshots, strict=True)):
            self._vehicles = self._built()
        with self.server.atomic():
            for vehicle, around, source, now in zip(
                self._vehicles, self._around, self._sources, snapshots, strict=True
            ):
                around.show(source.surroundings, layers)
                vehicle.show(now, self._ground_m, layers)
            if self._follows:
                x, y, z = snapshots[0].position_enu_m
                self._world.position = (-x, -y, -z)

    def tell(self, snapshots: Sequence[Snapshot], time_s: float, plays: bool) -> None:
        self.controls.show(words(self._names, snapshots), time_s, plays)

    def plot(self, time_s: float, *, anew: bool = False) -> None:
        if anew:
            self._plots.show([source.charts() for source in self._sources])
        self._plots.mark(time_s)

    def offer_commands(self, token: Token, modes: Callable[[], Sequence[str]]) -> None:
        def point(origin: Vector, direction: Vector) -> Vector | None:
            x, y, z = np.subtract(origin, self._world.position).tolist()
            return ground_point((x, y, z), direction, self._ground_m)

        CommandPanels(self.server, token, modes, self.controls.done, point)

    def recorded_html(self, times_s: Sequence[float]) -> str:
        """Return an animation that needs no server."""
        self.reveal()
        serializer = self.server.get_scene_serializer()
        before_s = times_s[0]
        for time_s in times_s:
            serializer.insert_sleep(time_s - before_s)
            before_s = time_s
            self.show([source.at(time_s) for source in self._sources])
        return serializer.as_html()

    def close(self) -> None:
        stop(self.server)

    def _built(self) -> list[VehicleScene]:
        scene = self.server.scene
        for vehicle in self._vehicles:
            vehicle.remove()
        return [VehicleScene(scene, number, each.airframe, self._scale) for number, each in enumerate(self._sources)]

    def _look(self, middle: tuple[float, float, float], extent_m: float) -> None:
        camera = self.server.initial_camera
        camera.position = tuple(np.add(middle, np.array([-1.2, -1.8, 1.0]) * extent_m).tolist())
        camera.look_at = middle
        camera.far = max(1000.0, 100.0 * extent_m)
