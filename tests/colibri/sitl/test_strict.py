import pytest

from colibri.autopilot.control.loop import ControlLoop
from colibri.sitl import Sitl


@pytest.mark.sitl(airborne=5.0)
def test_it_is_raised(sitl: Sitl, monkeypatch: pytest.MonkeyPatch) -> None:
    def decide(*_: object) -> None:
        raise ValueError("no")

    monkeypatch.setattr(ControlLoop, "decide", decide)
    with pytest.raises(ValueError, match="no"):
        sitl.run(0.1)
