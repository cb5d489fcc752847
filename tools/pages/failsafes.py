"""`python -m tools.pages.failsafes FOLDER`: writes `failsafes.md` and `failsafes.png` from the autopilot's table."""

import sys
from collections.abc import Iterator
from pathlib import Path
from textwrap import wrap
from typing import Any

from colibri.autopilot.commander.rules.failsafe_rule import CLEAR_AFTER_US
from colibri.autopilot.commander.rules.failsafe_table import MEANINGS, NAMES, TABLE, Action, Row
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.parameters.definitions import definitions
from colibri.mavlink.parameters.store import Kind, Parameter
from colibri.plant.vehicle.description import load_vehicle

_HEAD = """# Failsafes

This page and its picture are written from `autopilot/commander/rules/failsafe_table.py` by
`python -m tools.pages.failsafes docs`; a test holds that they agree.

![What leads to what, drawn from the table](failsafes.png)

Time is simulated time, and nothing that a clock measures enters: the same flight loses the same things. As they
are, the parameters change no flight in which nothing is lost.

## Which wins

Actions have ranks:

"""

_RULES = """
- An action begins once its condition has held for longer than its delay, and only if it ranks higher than what is
  flown: who lands for want of charge goes on landing when the ground station is lost. Of several that begin at once
  the highest is flown.
- Then it is flown until the pilot chooses another mode, the rotors stop, or a higher one begins. That its condition
  is over changes nothing but that it is said. A mode that was chosen is flown until something else is lost; one
  that needs a position is refused while there is none.
- On the ground with the rotors armed, every action but a warning stops the rotors. At each arming what holds begins
  anew.
- Each is said once as a STATUSTEXT: `ground station lost: return` when it begins (warning for hold, critical for
  what flies away or comes down, emergency for what stops the rotors), `ground station lost: land goes on` where
  what is flown ranks as high, and `ground station lost: cleared` once the condition has not held for {clear_s:g} s.
  HEARTBEAT's system_status is CRITICAL while a failsafe holds or returns, EMERGENCY while it comes down, and
  FLIGHT_TERMINATION once it has stopped the rotors in the air, until the next arming.
- BATTERY_STATUS.charge_state says LOW, CRITICAL or EMERGENCY exactly while the row of the battery holds. A battery
  that is critical, or whose voltage none can have, refuses arming.

## The table

Actions are given with their number, the default in bold; limits and delays with their defaults.

"""

_TAIL = """
Sensors that fail without leading to an action are told of by STATUSTEXT, SYS_STATUS and ESTIMATOR_STATUS
([sensors.md](sensors.md)): a magnetometer or barometer that is not believed costs accuracy, and the flight goes on.

## The plant silent

Not a row of the table: where the plant falls silent the autopilot has nothing to fly, and with the frames its time
stands still.

- **The autopilot, in lockstep**, says "no frame for 2 s, waiting for a plant", and calls it twenty times a second.
  Ground stations hear nothing meanwhile: no simulated second passes. A plant that answers where it was is flown on
  as if nothing had been; one that begins at time 0 is another flight, for which the vehicle restarts.
- **The plant, where the autopilot is silent,** says "no answer at t = 12.340 s, waiting for the autopilot", and
  sends its frame again every 20 ms. Time stands still, and the vehicle where it is, until an autopilot answers.
- **With `--realtime`** the plant does not wait. Where no command comes for `--cut-after` it stops the rotors, and says
  "no command for 0.5 s at t = 12.340 s: the rotors are stopped, waiting for the autopilot"; the next is obeyed.
- **Frames that were missed** are the row `telemetry missed`, at the first that comes again.
- **An autopilot that was killed** and started again in flight goes on with the failsafe that is flown; what still holds
  begins anew beside it, and who streams has the whole delay to be heard.

## Where PX4's defaults are not these

| parameter | PX4 | here | why |
|---|---:|---:|---|
| `COM_OBL_RC_ACT` | 0 | 5 | PX4 falls back to the pilot's sticks; in simulation nobody holds any, as a rule |
| `NAV_RCL_ACT` | 2 | 1 | sticks here are a joystick's; who lets go of it wants the vehicle to stay |
| `FD_FAIL_R`, `FD_FAIL_P` | 60 | 80 | the control law leans by up to 75° on its own |
| `CA_FAILURE_MODE` | 0 | 1 | a quadrotor on three rotors can do nothing but come down |
| `COM_LOW_BAT_ACT` | 0 | 0 | 1, which PX4 has given up, returns when low, lands when critical |
| `COM_FAIL_ACT_T` | 5 | - | an action begins at once; who wants to wait makes the delay longer |

`CBRK_FLIGHTTERM` is PX4's circuit breaker: at 121212 a tilt only warns. What PX4 has no parameter for is named
after its fashion: `COM_ATT_LOSS_…`, `COM_POS_FS_ACT`, `COM_EST_LOSS_…`, `COM_QP_LOSS_…`, `COM_LATE_…`,
`COM_TEL_LOSS_…`, `BAT_…_VOLT`, `BAT_LOW_T`, `COM_GNSSLOSS_T`, `GF_MARGIN`. Their
actions, and those of `COM_GNSSLOSS_ACT`, are numbered as those of `NAV_DLL_ACT`, with 4 to descend.

Held inside of a fence: with `GF_ACTION` 2, `GF_PREDICT` 1 and `GF_MARGIN` 3 a vehicle that flies outwards in a
circle of 15 m stops at 12 m, whoever pushes the stick.
"""

_LADDER = (Action.HOLD, Action.RETURN, Action.LAND, Action.DESCEND, Action.TERMINATE)
_STEP, _LINE, _WIDTH = 1.45, 0.19, 84
_STATE = {"boxstyle": "round,pad=0.45", "facecolor": "white", "edgecolor": "#223344"}


def page() -> str:
    """Return the page."""
    rules = _RULES.format(clear_s=CLEAR_AFTER_US * 1e-6)
    return _HEAD + "\n".join(_ranks()) + "\n" + rules + "\n".join(_rows()) + "\n" + _TAIL


def _ranks() -> Iterator[str]:
    yield "| rank | action | what it is |"
    yield "|---:|---|---|"
    for action in sorted(Action, reverse=True):
        yield f"| {int(action)} | {NAMES[action]} | {MEANINGS[action]} |"


def _rows() -> Iterator[str]:
    profile = load_profile("flight")
    known = {each.name: each for each in definitions(profile, load_vehicle(profile.simulation.vehicle))}
    yield "| condition | holds when | limits | delay | action | over when |"
    yield "|---|---|---|---|---|---|"
    for row in TABLE:
        limits = "<br>".join(_shown(known[name]) for name in row.limits) or "-"
        delay = _shown(known[row.delay]) if row.delay else "-"
        action = f"`{row.parameter}`: {_choices(row)}"
        yield f"| {row.condition} | {row.holds} | {limits} | {delay} | {action} | {row.clears} |"


def _shown(parameter: Parameter) -> str:
    whole = parameter.kind == Kind.INT
    value = str(int(parameter.default)) if whole else f"{parameter.default:.6g}"
    unit = "" if parameter.unit in ("", "norm") else f" {parameter.unit}"
    return f"`{parameter.name}` {value}{unit}"


def _choices(row: Row) -> str:
    shown = (f"{number} {NAMES[action]}" for number, action in row.choices)
    return ", ".join(
        f"**{text}**" if number == row.default else text for text, (number, _) in zip(shown, row.choices, strict=True)
    )


def draw(path: Path) -> None:
    """Draw what leads to what as a PNG."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.patches import FancyBboxPatch

    figure, axes = plt.subplots(figsize=(13.0, 7.6))
    axes.set_xlim(0.0, 13.0)
    axes.set_ylim(-0.9, 7.4)
    axes.axis("off")
    top = _STEP * (len(_LADDER) - 1)
    for x, name in ((0.1, "what\nthe\npilot\nchose"), (11.9, "disarmed")):
        axes.add_patch(FancyBboxPatch((x, -0.3), 1.0, top + 0.6, boxstyle="round,pad=0.05", facecolor="white"))
        axes.text(x + 0.5, 0.5 * top, name, ha="center", va="center", fontsize=11)
    for rung, action in enumerate(_LADDER):
        y = _STEP * rung
        axes.text(8.6, y, NAMES[action], ha="center", va="center", fontsize=11, bbox=_STATE, zorder=3)
        _arrow(axes, (1.15, y), (7.8, y))
        _label(axes, 4.4, y + 0.08, *_leading_to(action))
        if action is not Action.HOLD:
            _arrow(axes, (9.4, y), (11.85, y), "#8899aa")
            _arrow(axes, (8.6, y - _STEP + 0.3), (8.6, y - 0.3), "#aa3322")
    axes.text(8.7, 0.5 * _STEP, "a higher rank alone", fontsize=9, color="#aa3322", va="center")
    axes.text(10.6, top + 0.08, "at once", fontsize=9, color="#556677", ha="center", va="bottom")
    axes.text(10.6, _STEP + 0.08, "landed", fontsize=9, color="#556677", ha="center", va="bottom")
    _arrow(axes, (7.8, -0.2), (1.15, -0.2), "#338855")
    axes.text(
        4.4, -0.28, "the pilot chooses a mode, from any of them", fontsize=9, color="#338855", ha="center", va="top"
    )
    note = "bold: by default    plain: where a parameter says so    what only warns is in the table"
    axes.text(0.1, top + 1.0, note, fontsize=9, color="#445566", va="bottom")
    figure.savefig(path, dpi=110, bbox_inches="tight")
    plt.close(figure)


def _leading_to(action: Action) -> tuple[str, str]:
    """Return the conditions that lead to an action by default, and those that can."""
    default = [str(row.condition) for row in TABLE if dict(row.choices)[row.default] is action]
    able = [
        str(row.condition)
        for row in TABLE
        if str(row.condition) not in default and action in dict(row.choices).values()
    ]
    return ", ".join(default), ", ".join(able)


def _arrow(axes: Any, start: tuple[float, float], end: tuple[float, float], color: str = "#225588") -> None:
    axes.annotate(
        "", xy=end, xytext=start, arrowprops={"arrowstyle": "-|>", "color": color, "linewidth": 1.2}, zorder=1
    )


def _label(axes: Any, x: float, y: float, default: str, able: str) -> None:
    """Write onto an arrow what leads along it: by default in bold, above what can."""
    heavy, light = (wrap(text, _WIDTH) for text in (default, able))
    for up, line in enumerate(reversed(heavy + light)):
        weight = "bold" if up >= len(light) else "normal"
        axes.text(x, y + _LINE * up, line, fontsize=8, weight=weight, color="#225588", ha="center", va="bottom")


def main() -> int:
    """Write page and picture into the folder that the command line names."""
    folder = Path(sys.argv[1])
    (folder / "failsafes.md").write_text(page())
    draw(folder / "failsafes.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
