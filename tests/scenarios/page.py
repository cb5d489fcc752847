"""Writes `docs/scenarios-flown.md` from the scenarios themselves: `python -m tests.scenarios.page docs`."""

import sys
from pathlib import Path

from tests.scenarios.groups import GROUPS
from tests.scenarios.words.scenario import FleetScenario, Scenario

PAGE = "scenarios-flown.md"


def page() -> str:
    count = sum(len(group) for group in GROUPS.values())
    flights = sum(len(each.seeds) if isinstance(each, Scenario) else 1 for group in GROUPS.values() for each in group)
    calm = [each for group in GROUPS.values() for each in group if isinstance(each, Scenario) and each.calm]
    lines = [
        "# The scenarios",
        "",
        f"{count} scenarios, {flights} tests with their seeds, in `tests/scenarios/`: `make scenarios` flies them over",
        "UDP, `make soak` again and again. This page is written from them by `python -m tests.scenarios.page docs`; a",
        "test holds that they agree.",
        "",
        "`make scenarios-rough` flies them over ground links that lose 30 % each way, with 50 ms of jitter: all but",
        "",
        *(f"- {each.name}: {each.calm}" for each in calm),
        "",
        "AP is ArduPilot's autotest, PX4 its mavsdk_tests, MAVSDK its system tests: the numbers of trusted suites, and",
        "beside each what is asked for here. Times are simulated, places are true.",
    ]
    for name, group in GROUPS.items():
        lines += ["", f"## {name.capitalize()}", "", "| scenario | a peer asks for | here |", "|---|---|---|"]
        lines += [f"| {each.name} | {each.peer} | {each.holds}{_seeds(each)} |" for each in group]
    return "\n".join(lines) + "\n"


def _seeds(each: Scenario | FleetScenario) -> str:
    return f"; {len(each.seeds)} seeds" if isinstance(each, Scenario) and len(each.seeds) > 1 else ""


def main() -> int:
    (Path(sys.argv[1]) / PAGE).write_text(page(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
