"""Commands to a live vehicle, in each browser after its token."""

from collections.abc import Callable, Sequence
from queue import SimpleQueue
from typing import Any

import viser

from colibri.common.types import Vector
from colibri.view.page.controls import Done
from colibri.view.page.server import Token

ORDERS = {"Arm": "arm", "Disarm": "disarm", "Take off": "take off", "Land": "land", "Return": "return"}
"""Buttons and their commands."""
_HEIGHT_M = 3.0


class CommandPanels:
    """The command panels of all browsers; commands go into the queue `done`."""

    def __init__(
        self,
        server: viser.ViserServer,
        token: Token,
        modes: Callable[[], Sequence[str]],
        done: "SimpleQueue[Done]",
        ground_point: Callable[[Vector, Vector], Vector | None],
    ) -> None:
        self._token = token
        self._modes = modes
        self._done = done
        self._ground_point = ground_point
        self._goes: dict[int, tuple[viser.GuiInputHandle[bool], viser.GuiInputHandle[float]]] = {}
        server.on_client_connect(self._ask)
        server.on_client_disconnect(self._forget)
        server.scene.on_click()(self._clicked)

    def _ask(self, client: viser.ClientHandle) -> None:
        folder = client.gui.add_folder("Commands")
        with folder:
            said = client.gui.add_text("Token", "", hint="as the terminal says it")
            button = client.gui.add_button("Unlock")
            answer = client.gui.add_markdown("")

        def check(_: viser.GuiEvent[Any]) -> None:
            if self._token.matches(said.value):
                folder.remove()
                self._offer(client)
            else:
                answer.content = "That is not the token."

        button.on_click(check)

    def _offer(self, client: viser.ClientHandle) -> None:
        gui = client.gui
        with gui.add_folder("Commands"):
            height = gui.add_number("Height, m", _HEIGHT_M, min=0.5, max=120.0, step=0.5)
            for label, order in ORDERS.items():
                button = gui.add_button(label, color="red" if label == "Disarm" else None)
                self._on_click(button, order, height)
            modes = list(self._modes())
            if modes:
                mode = gui.add_dropdown("Mode", modes)
                change = gui.add_button("Change mode")
                change.on_click(lambda _: self._order("mode", mode.value))
            goes = gui.add_checkbox("Go to: click the ground", initial_value=False)
        self._goes[client.client_id] = (goes, height)

    def _on_click(self, button: viser.GuiButtonHandle, order: str, height: viser.GuiInputHandle[float]) -> None:
        button.on_click(lambda _: self._order(order, float(height.value)))

    def _forget(self, client: viser.ClientHandle) -> None:
        self._goes.pop(client.client_id, None)

    def _clicked(self, event: viser.SceneClickEvent) -> None:
        goes, height = self._goes.get(event.client_id, (None, None))
        if goes is None or height is None or not goes.value:
            return
        place = self._ground_point(event.ray_origin, event.ray_direction)
        if place is not None:
            self._order("go to", (place[0], place[1], place[2] + float(height.value)))

    def _order(self, what: str, value: Any) -> None:
        self._done.put(Done("order", (what, value)))
