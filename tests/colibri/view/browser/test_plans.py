"""Mission, geofence and trail of a live vehicle, as a real browser draws them."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytestmark = pytest.mark.view
CLEARLY = 50  # by how much one part of a colour is stronger than another where something has that colour


def test_a_mission_inside_its_fence_is_drawn(tmp_path: Path) -> None:
    from tools.pages.pictures.view import mission

    mission(tmp_path / "mission.png")
    picture = np.asarray(Image.open(tmp_path / "mission.png").convert("RGB"), dtype=int)[:, 300:890]
    red, green, blue = np.moveaxis(picture, 2, 0)
    drawn = {
        "keeps in, green": (green > red + CLEARLY) & (green > blue + CLEARLY),
        "keeps out, red": (red > green + 2 * CLEARLY) & (red > blue + CLEARLY),
        "mission, brown": (red > green + CLEARLY // 2) & (green > blue + CLEARLY),
        "trail, blue": (blue > green + CLEARLY) & (green > red + CLEARLY),
    }
    assert {what: int(there.sum()) for what, there in drawn.items() if there.sum() < 150} == {}
