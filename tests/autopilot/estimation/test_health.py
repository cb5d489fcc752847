from colibri.autopilot.estimation.estimate import Health
from colibri.autopilot.estimation.health import HealthWatch, not_known
from colibri.mavlink.services.statustext import INFO, WARNING

WELL = Health(True, True, True, True, True, True, False, None, False, True, True, True, True, ())


def test_nothing_is_said_while_all_is_well() -> None:
    assert HealthWatch().lines(WELL) == []


def test_each_change_is_said_once() -> None:
    watch = HealthWatch()
    lost = WELL._replace(not_accepted=("rangefinder",))
    assert watch.lines(lost) == [(WARNING, "rangefinder not accepted")]
    assert watch.lines(lost) == []
    assert watch.lines(lost._replace(accel_bias=False)) == [(WARNING, "accelerometer off: bias reset")]
    assert watch.lines(WELL) == [(INFO, "accelerometer accepted again"), (INFO, "rangefinder accepted again")]


def test_what_is_not_known_is_named() -> None:
    assert not_known(WELL) == ""
    assert not_known(WELL._replace(dead_reckoning=True)) == "no position estimate"
    assert not_known(WELL._replace(heading=False, height=False)) == "no heading estimate, no height estimate"
