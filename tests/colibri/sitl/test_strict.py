"""What a part of the autopilot raises in flight fails a test, unless it says that it may be replaced."""

import pytest

from colibri.autopilot.control.loop import ControlLoop
from colibri.sitl import Sitl


def break_the_law(monkeypatch: pytest.MonkeyPatch) -> None:
    def decide(*_: object) -> None:
        raise ValueError("no")

    monkeypatch.setattr(ControlLoop, "decide", decide)


@pytest.mark.sitl(airborne=5.0)
def test_it_is_raised(sitl: Sitl, monkeypatch: pytest.MonkeyPatch) -> None:
    break_the_law(monkeypatch)
    with pytest.raises(ValueError, match="no"):
        sitl.run(0.1)


@pytest.mark.sitl(airborne=5.0, strict=False)
def test_it_is_replaced_and_said(sitl: Sitl, monkeypatch: pytest.MonkeyPatch) -> None:
    break_the_law(monkeypatch)
    sitl.run(1.0)
    assert any("control law failed: plain law flies" in text for text in sitl.texts)
    assert abs(sitl.position[2] - 5.0) < 0.3
