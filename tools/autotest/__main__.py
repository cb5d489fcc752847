"""`python -m tools.autotest CHECKOUT`: ArduPilot's own copter tests, unmodified, flown on Colibri; 1 if any fails.

CHECKOUT is a checkout of ArduPilot (GPL), best of the commit for which `not_applicable.toml` was made; nothing of it is
part of Colibri. Its suite needs pexpect, MAVProxy, pymavlink, numpy and lxml, in the environment of --python. In place
of the binary it starts `tools/autotest/vehicle.py`. Ports 5760, 5762 and 5501 must be free.
"""

import json
import os
import shlex
import signal
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from time import monotonic, sleep
from typing import Any, NamedTuple

from colibri.analysis.tables import markdown
from colibri.common.errors import Error, shown, unknown
from colibri.common.process.arguments import ArgumentParser, positive
from colibri.common.process.lifecycle import EXIT_FAILED, handle_endings, interrupt, one_line
from colibri.mavlink.hil.feedback import Feedback
from tools.autotest.vehicle import FEEDBACK

HERE, ROOT = Path(__file__).parent, Path(__file__).parents[2]
PINNED = "90700977c553d2dfd95a305acf1c3e098e4d9477"
_LOOK_EVERY_S, _GRACE_S = 0.2, 15.0
PASSED, FAILED, LEFT_OUT = "passed", "failed", "not applicable"


class Outcome(NamedTuple):
    test: str
    outcome: str
    reason: str = ""  # one line
    wall_s: int = 0


def main(arguments: Sequence[str] | None = None) -> int:
    parser = ArgumentParser(prog="python -m tools.autotest", description=__doc__)
    parser.add_argument("checkout", type=Path, metavar="CHECKOUT", help="a checkout of ArduPilot")
    parser.add_argument("tests", nargs="*", metavar="TEST", help="default: all that are applicable")
    parser.value("--python", "FILE", "that has the suite's libraries", default=sys.executable)
    parser.value("--out", "DIR", "for logs and table.md", type=Path, default=Path("out/autotest"))
    parser.value("--speedup", "N", "times real time at most", type=positive, default=100.0)
    parser.value("--feedback", "state|sensors", "input of the autopilot", type=Feedback, default=Feedback.STATE)
    parser.value("--limit", "S", "wall-clock time of one test", type=positive, default=900.0)
    args = parser.parse_intermixed_args(arguments)
    handle_endings(interrupt)
    with one_line(kept="; the outcomes so far are above"):
        runner = Runner(args.checkout, args.python, args.out.resolve(), args.speedup, args.feedback, args.limit)
        content = tomllib.loads((HERE / "not_applicable.toml").read_text(encoding="utf-8"))
        left_out = {name: reason for reason, several in content.items() for name in several}
        names = runner.names()
        for name in args.tests:
            if name not in names:
                raise Error(unknown("test", name, names))
        outcomes = runner.run(args.tests or [name for name in names if name not in left_out])
    if not args.tests:
        outcomes += [Outcome(name, LEFT_OUT, left_out[name]) for name in names if name in left_out]
    text = table(outcomes, version(args.checkout))
    (args.out / "table.md").write_text(text, encoding="utf-8")
    print(text)
    return EXIT_FAILED if any(each.outcome == FAILED for each in outcomes) else 0


def table(outcomes: Sequence[Outcome], version: str) -> str:
    counts = Counter(each.outcome for each in outcomes)
    head = f"ArduPilot {version}: " + ", ".join(f"{counts[each]} {each}" for each in (PASSED, FAILED, LEFT_OUT))
    rows = [(it.test, it.outcome, it.reason.replace("|", "/")) for it in outcomes]
    return f"{head}\n\n{markdown(('test', 'outcome', 'reason'), rows, names=3)}"


def version(checkout: Path) -> str:
    git = ["git", "-C", str(checkout), "rev-parse", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip()
    return commit[:8] if commit == PINNED else f"{commit[:8]} (reasons are those of {PINNED[:8]})"


class Runner:
    def __init__(
        self, checkout: Path, python: str, out: Path, speedup: float, feedback: Feedback, limit_s: float
    ) -> None:
        self._python, self._out, self._limit_s = python, out, limit_s
        self._suite = checkout.resolve() / "Tools" / "autotest"
        if not (self._suite / "arducopter.py").is_file():
            raise Error(f'checkout "{checkout}" has no Tools/autotest/arducopter.py: name a checkout of ArduPilot')
        self._results, logs, vehicle = out / "results.jsonl", out / "buildlogs", out / "arducopter"
        logs.mkdir(parents=True, exist_ok=True)
        command = shlex.join([sys.executable, "-m", "tools.autotest.vehicle"])
        vehicle.write_text(f'#!/bin/sh\nexport PYTHONPATH={shlex.quote(str(ROOT))}\nexec {command} "$@"\n')
        vehicle.chmod(0o755)
        self._command: list[str | Path] = [
            python,
            HERE / "suite.py",
            self._suite,
            vehicle,
            self._results,
            f"{speedup:g}",
        ]
        path = f"{Path(python).parent}{os.pathsep}{os.environ.get('PATH', '')}"
        own = {"PATH": path, "PYTHONDONTWRITEBYTECODE": "1", "BUILDLOGS": str(logs), FEEDBACK: feedback}
        self._options: dict[str, Any] = {"cwd": out, "env": {**os.environ, **own}}

    def names(self) -> list[str]:
        """Return the names of the suite's tests; Error if it cannot be imported."""
        try:
            done = subprocess.run(self._command, **self._options, capture_output=True, text=True, check=False)
        except OSError as error:
            raise Error(f'--python "{self._python}": {error.strerror}') from error
        if done.returncode:
            why = (done.stderr.strip().splitlines() or ["no message"])[-1]
            raise Error(f"the suite cannot be imported by --python {self._python}: {shown(why)}")
        names: list[str] = json.loads(done.stdout.strip().splitlines()[-1])
        return names

    def run(self, names: Sequence[str]) -> list[Outcome]:
        """Run tests in turn; the suite starts anew behind a test that ends it."""
        outcomes: list[Outcome] = []
        while len(outcomes) < len(names):
            why = self._run_suite(names[len(outcomes) :], outcomes)
            if why:
                outcomes.append(_told(Outcome(names[len(outcomes)], FAILED, why)))
        return outcomes

    def _run_suite(self, names: Sequence[str], outcomes: list[Outcome]) -> str:
        """Add outcomes; return why the next test has none."""
        self._results.unlink(missing_ok=True)
        with (self._out / "suite.txt").open("a") as log:
            suite = subprocess.Popen([*self._command, *names], **self._options, stdout=log, stderr=log)
        ended, since_s = 0, monotonic()
        try:
            while True:
                running, notes = suite.poll() is None, self._notes()
                done = [note for note in notes if "passed" in note]
                for note in done[ended:]:
                    reason = shown((note["reason"].splitlines() or [""])[0])
                    outcome = PASSED if note["passed"] else FAILED
                    outcomes.append(_told(Outcome(note["test"], outcome, reason, note["wall_s"])))
                    since_s = monotonic()
                ended = len(done)
                if not running and not notes:
                    raise Error(f"the suite ended before its first test: see {self._out / 'suite.txt'}")
                if not running:
                    return "" if len(notes) == 2 * ended else f"the suite ended with exit code {suite.returncode}"
                if monotonic() - since_s > self._limit_s:
                    return f"took more than {self._limit_s:g} s"
                sleep(_LOOK_EVERY_S)
        finally:
            _end(suite)

    def _notes(self) -> list[Any]:
        try:
            return [json.loads(line) for line in self._results.read_text(encoding="utf-8").splitlines()]
        except (FileNotFoundError, json.JSONDecodeError):  # a line is being written
            return []


def _told(outcome: Outcome) -> Outcome:
    print(f"{outcome.test}: {outcome.outcome} {outcome.reason} ({outcome.wall_s} s)", file=sys.stderr, flush=True)
    return outcome


def _end(suite: subprocess.Popen[Any]) -> None:
    """End the suite as Ctrl-C does, so that it ends its vehicle."""
    if suite.poll() is None:
        suite.send_signal(signal.SIGINT)
        try:
            suite.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            suite.kill()
            suite.wait()


if __name__ == "__main__":
    sys.exit(main())
