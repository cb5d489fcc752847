"""Runs tests of ArduPilot's copter suite, unmodified, under the Python that has its libraries.

`python suite.py SUITE_FOLDER VEHICLE RESULTS SPEEDUP TEST ...`; without tests it prints the names of all. Two lines of
JSON for each test go to RESULTS: its name as it begins, and its outcome.
"""

import json
import signal
import sys
from importlib import import_module
from pathlib import Path
from typing import Any


def main(folder: str, vehicle: str, results: str, speedup: str, *names: str) -> int:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job ignores it
    sys.path.insert(0, folder)
    suite: Any = import_module("arducopter")
    copter = suite.AutoTestCopter(vehicle, speedup=float(speedup), logs_dir=str(Path(results).parent))
    framework: Any = import_module("vehicle_test_suite")
    tests = [each if isinstance(each, framework.Test) else framework.Test(each) for each in copter.tests()]
    if not names:
        print(json.dumps([test.name for test in tests]))
        return 0
    run_one, chosen = copter.run_one_test, [test for name in names for test in tests if test.name == name]

    def run_and_note(test: Any) -> Any:
        _note(results, test=test.name)
        try:
            result = run_one(test)
        except Exception as error:  # the suite cannot go on
            _note(results, test=test.name, passed=False, reason=repr(error), wall_s=0)
            raise
        reason = result.exception or result.reason or "the framework's checks after the test"
        told = "" if result.passed else str(reason) or repr(reason)
        _note(results, test=test.name, passed=result.passed, reason=told, wall_s=round(result.time_elapsed))
        return result

    copter.run_one_test = run_and_note
    try:
        copter.run_tests(chosen)
    finally:
        copter.rc_thread_should_quit = True  # or it keeps the process alive
    return 0


def _note(results: str, **facts: Any) -> None:
    with Path(results).open("a", encoding="utf-8") as file:
        print(json.dumps(facts), file=file, flush=True)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
