"""The 3D scene of snapshots and surroundings."""

from typing import Any

import numpy as np
import viser

from colibri.common.types import Array, PerRotor
from colibri.view import geometry
from colibri.view.geometry import Colour
from colibri.view.snapshot import NO_POINTS, Mark, Snapshot, Surroundings, VehicleShape

COLOURS: tuple[Colour, ...] = ((30, 110, 210), (230, 120, 20), (40, 150, 70), (150, 60, 170))  # by vehicle
LAYERS = ("trail", "path", "reference", "horizon", "thrust", "estimate", "wind", "mission, fence")
REFERENCE: Colour = (120, 120, 120)
HORIZON: Colour = (220, 30, 160)
WIND: Colour = (60, 160, 190)
HOME: Colour = (20, 130, 60)
MISSION: Colour = (150, 110, 0)
KEEPS_IN: Colour = (0, 150, 80)
KEEPS_OUT: Colour = (210, 30, 30)
RALLY: Colour = (110, 60, 190)
_FRONT: Colour = (220, 50, 40)
_DARK: Colour = (60, 60, 65)
_WIND_S = 0.4  # length of the wind's arrow in time, at true size
_ABOVE, _BELOW = (0.0, 0.0, 0.2), (0.0, 0.0, -0.2)
_NO_SEGMENTS: Any = np.zeros((1, 2, 3), dtype=np.float32)


class VehicleScene:
    """One vehicle with its lines, at `scale` times its size."""

    def __init__(self, scene: viser.SceneApi, number: int, airframe: VehicleShape, scale: float) -> None:
        self._scene = scene
        self._root = f"/world/{number}"
        self._airframe = airframe
        self._scale = scale
        self.rotors = len(airframe.rotors_m)
        self._angles: PerRotor = (0.0,) * self.rotors
        self._time_s: float | None = None
        colour = COLOURS[number % len(COLOURS)]
        self._frame = scene.add_frame(self._root, show_axes=False)
        self._body = scene.add_frame(f"{self._root}/vehicle", show_axes=False)
        self._blades, self._discs = self._build(colour)
        thrusts = geometry.thrust_arrows(airframe, self._angles, scale)
        self._thrust = self._arrows("vehicle/thrust", thrusts, (200, 60, 60), 0.06, 0.16, 0.35)
        self._trail = self._line("trail", colour, 3.0)
        self._horizon = self._line("horizon", HORIZON, 5.0)
        self._to_reference = self._line("to_reference", REFERENCE, 1.5)
        self._to_ground = self._line("to_ground", REFERENCE, 1.0)
        dot = 0.35 * airframe.radius_m * scale
        self._reference = scene.add_icosphere(f"{self._root}/reference", radius=dot, color=REFERENCE)
        self._estimate = scene.add_icosphere(f"{self._root}/estimate", radius=1.0, color=colour, opacity=0.1)
        self._wind = self._arrows("wind", _NO_SEGMENTS, WIND, 0.12, 0.4, 0.9)

    def show(self, now: Snapshot, ground_m: float, layers: frozenset[str]) -> None:
        elapsed_s = 0.0 if self._time_s is None else min(max(now.time_s - self._time_s, 0.0), 0.2)
        self._time_s = now.time_s
        self._angles = geometry.blade_angles(now.rotors, self._airframe.spins, self._angles, elapsed_s)
        self._body.position = now.position_enu_m
        self._body.wxyz = now.attitude
        for blade, disc, angle, part in zip(self._blades, self._discs, self._angles, now.rotors, strict=True):
            blade.wxyz = geometry.about_up(angle)
            disc.color = geometry.rotor_colour(part)
        _show(self._thrust, geometry.thrust_arrows(self._airframe, now.rotors, self._scale), layers, "thrust")
        _show(self._trail, geometry.segments(now.trail), layers, "trail")
        _show(self._horizon, geometry.segments(now.horizon), layers, "horizon")
        _show(self._wind, geometry.arrow(now.position_enu_m, now.wind_enu_m_s, _WIND_S * self._scale), layers, "wind")
        east, north, up = now.position_enu_m
        self._to_ground.points = geometry.segments(np.array([[east, north, ground_m], [east, north, up]]))
        known = np.isfinite(now.reference_enu_m).all() and "reference" in layers
        self._reference.visible = bool(known)
        if known:
            self._reference.position = now.reference_enu_m
        between = np.array([now.position_enu_m, now.reference_enu_m])
        _show(self._to_reference, geometry.segments(between), layers, "reference")
        known = np.isfinite(now.estimate_enu_m).all() and "estimate" in layers
        self._estimate.visible = bool(known)
        if known:
            self._estimate.position = now.estimate_enu_m
            x, y, z = (3.0 * sigma for sigma in now.sigma_m)
            self._estimate.scale = (max(x, 0.01), max(y, 0.01), max(z, 0.01))

    def remove(self) -> None:
        self._frame.remove()

    def _arrows(self, name: str, points: Any, colour: Colour, shaft: float, head: float, length: float) -> Any:
        """Add arrows with radii and the length of the head in radii of a rotor."""
        at, radius = f"{self._root}/{name}", self._airframe.radius_m * self._scale
        sizes: Any = {"shaft_radius": shaft * radius, "head_radius": head * radius, "head_length": length * radius}
        return self._scene.add_arrows(at, points, colors=colour, **sizes)

    def _line(self, name: str, colour: Colour, width: float) -> viser.LineSegmentsHandle:
        return self._scene.add_line_segments(
            f"{self._root}/{name}", _NO_SEGMENTS, colors=colour, thickness=width, thickness_units="screen"
        )

    def _build(self, colour: Colour) -> tuple[list[viser.BoxHandle], list[viser.CylinderHandle]]:
        scene, at, scale = self._scene, f"{self._root}/vehicle", self._scale
        radius = self._airframe.radius_m * scale
        scene.add_box(f"{at}/body", dimensions=(0.9 * radius, 0.6 * radius, 0.3 * radius), color=colour)
        nose = (0.55 * radius, 0.0, 0.0)
        scene.add_box(f"{at}/nose", dimensions=(0.3 * radius, 0.25 * radius, 0.2 * radius), color=_FRONT, position=nose)
        blades, discs = [], []
        for rotor, (x, y) in enumerate(self._airframe.rotors_m):
            place = (scale * x, scale * y, 0.0)
            length, yaw = float(np.hypot(*place[:2])), float(np.arctan2(y, x))
            scene.add_box(
                f"{at}/arm{rotor}",
                dimensions=(length, 0.12 * radius, 0.1 * radius),
                color=_FRONT if x > 0.0 and abs(y) <= x * 1.5 else _DARK,
                position=(place[0] / 2.0, place[1] / 2.0, 0.0),
                wxyz=geometry.about_up(yaw),
            )
            if self._airframe.foot_m:
                foot = scale * self._airframe.foot_m
                scene.add_cylinder(
                    f"{at}/foot{rotor}", 0.05 * radius, foot, _DARK, position=(place[0], place[1], -foot / 2.0)
                )
            above = (place[0], place[1], 0.12 * radius)
            discs.append(scene.add_cylinder(f"{at}/disc{rotor}", radius, 0.03 * radius, opacity=0.7, position=above))
            size = (1.9 * radius, 0.2 * radius, 0.07 * radius)
            blades.append(scene.add_box(f"{at}/blade{rotor}", dimensions=size, color=_DARK, position=above))
        return blades, discs


class SurroundingsScene:
    """Ground, paths, mission, fence, home and rally points."""

    def __init__(self, scene: viser.SceneApi, number: int) -> None:
        self._scene = scene
        self._root = f"/world/around{number}"
        self._frame = scene.add_frame(self._root, show_axes=False)
        self._colour = COLOURS[number % len(COLOURS)]
        self._layers: dict[str, list[Any]] = {}
        self.shown: Surroundings | None = None

    def show(self, around: Surroundings, layers: frozenset[str]) -> None:
        if around is not self.shown:
            self.shown = around
            self._frame.remove()
            self._frame = self._scene.add_frame(self._root, show_axes=False)
            self._layers = {"path": [], "reference": [], "mission, fence": []}
            self._draw(around)
        for layer, handles in self._layers.items():
            for handle in handles:
                handle.visible = layer in layers

    def _draw(self, around: Surroundings) -> None:
        lighter = tuple((255 + channel) // 2 for channel in self._colour)
        self._line("path", "path", around.path, lighter, 2.0)
        self._line("reference", "reference", around.reference_path, (150, 150, 150), 1.5)
        places = [mark.place_enu_m for mark in around.mission]
        self._line("mission, fence", "mission", np.array(places) if places else NO_POINTS, MISSION, 3.0)
        self._marks("mission", around.mission, MISSION)
        self._marks("rally", around.rally, RALLY)
        if np.isfinite(around.home_enu_m).all():
            self._marks("home", (Mark(around.home_enu_m, "home"),), HOME, below=True)
        for number, zone in enumerate(around.fence):
            lines = geometry.zone_segments(zone, around.ground_m, around.ceiling_m)
            colour = KEEPS_IN if zone.keeps_in else KEEPS_OUT
            self._add("mission, fence", self._segments(f"fence{number}", lines, colour, 2.5))

    def _line(self, layer: str, name: str, points: Array, colour: Any, width: float) -> None:
        lines = geometry.segments(points)
        if len(lines):
            self._add(layer, self._segments(name, lines, colour, width))

    def _segments(self, name: str, lines: Any, colour: Any, width: float) -> viser.LineSegmentsHandle:
        at = f"{self._root}/{name}"
        return self._scene.add_line_segments(at, lines, colors=colour, thickness=width, thickness_units="screen")

    def _marks(self, name: str, marks: tuple[Mark, ...], colour: Colour, *, below: bool = False) -> None:
        for number, mark in enumerate(marks):
            at = f"{self._root}/{name}{number}"
            self._add("mission, fence", self._scene.add_icosphere(at, 0.12, colour, position=mark.place_enu_m))
            label = self._scene.add_label(
                f"{at}/label",
                mark.text,
                anchor="top-center" if below else "bottom-center",
                position=_BELOW if below else _ABOVE,
                font_screen_scale=0.8,
            )
            self._add("mission, fence", label)

    def _add(self, layer: str, handle: Any) -> None:
        self._layers[layer].append(handle)


def add_ground(scene: viser.SceneApi, ground_m: float, extent_m: float) -> None:
    cell = 1.0 if extent_m < 40.0 else 10.0
    scene.configure_default_lights(cast_shadow=False)
    scene.add_grid(
        "/world/ground",
        infinite_grid=True,
        cell_size=cell,
        section_size=10.0 * cell,
        cell_color=(205, 210, 205),
        section_color=(160, 165, 160),
        fade_distance=30.0 * extent_m,
        position=(0.0, 0.0, ground_m - 0.005),
    )
    scene.add_arrows(
        "/world/north",
        np.array([[[0.0, 0.0, ground_m], [0.0, 0.25 * extent_m, ground_m]]]),
        colors=(90, 90, 90),
        shaft_radius=0.006 * extent_m,
        head_radius=0.02 * extent_m,
        head_length=0.05 * extent_m,
    )
    scene.add_label("/world/north/label", "N", position=(0.0, 0.27 * extent_m, ground_m), font_screen_scale=0.9)


def _show(handle: Any, points: Any, layers: frozenset[str], layer: str) -> None:
    visible = layer in layers and points is not None and len(points) > 0
    if handle.visible != visible:
        handle.visible = visible
    if visible:
        handle.points = np.asarray(points, dtype=np.float32)
