"""`python -m tests.scenarios.page docs`: write `scenarios-flown.md`."""

import sys
from itertools import groupby
from pathlib import Path

from tests.scenarios.groups import GROUPS
from tests.scenarios.words.scenario import FleetScenario, Scenario

PAGE = "scenarios-flown.md"


def page() -> str:
    count = sum(len(group) for group in GROUPS.values())
    flights = sum(len(each.seeds) if isinstance(each, Scenario) else 1 for group in GROUPS.values() for each in group)
    calm = [each for group in GROUPS.values() for each in group if isinstance(each, Scenario) and each.calm]
    lines = [
        "# Flown scenarios",
        "",
        f"The {count} scenarios in `tests/scenarios/` ({flights} flights with their seeds): each requirement",
        "beside its reference in PX4's, ArduPilot's or MAVSDK's tests. Write yours: [scenarios.md](scenarios.md).",
        "",
        "- `make scenarios` flies them over UDP, `make soak` repeatedly.",
        "- `make scenarios-rough` flies them over ground links with 30 % loss each way and 50 ms of jitter, except:",
        *(f"    - {each.name}: {each.calm}" for each in calm),
        "",
        "AP is ArduPilot's autotest, PX4 its mavsdk_tests, MAVSDK its system tests. Others are our own.",
        "Times are simulated; positions are the plant's. Written by `python -m tests.scenarios.page docs`.",
    ]
    for name, group in GROUPS.items():
        lines += ["", f"## {name.capitalize()}", "", "| scenario | reference | required here |", "|---|---|---|"]
        for text, alike in groupby(group, key=_requirements):
            lines.append(f"| {', '.join(each.name for each in alike)} | {text} |")
    return "\n".join(lines) + "\n"


def _requirements(each: Scenario | FleetScenario) -> str:
    """Return the last two cells of a row."""
    reference = "-" if each.peer == "ours" else each.peer.removeprefix("ours: ").removeprefix("ours ")
    seeds = f"; {len(each.seeds)} seeds" if isinstance(each, Scenario) and len(each.seeds) > 1 else ""
    return f"{reference} | {each.holds}{seeds}".replace("at most", "≤")


def main() -> int:
    (Path(sys.argv[1]) / PAGE).write_text(page(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
