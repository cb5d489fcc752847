"""`python -m tools.autotest` with a made-up suite, and the command line of its vehicle."""

from pathlib import Path

import pytest

from colibri.mavlink.hil.feedback import Feedback
from tools.autotest import vehicle
from tools.autotest.__main__ import main

FRAMEWORK = """
class Test:
    def __init__(self, function):
        self.name, self.function = function.__name__, function


class Result:
    def __init__(self, exception):
        self.passed, self.exception, self.reason, self.time_elapsed = exception is None, exception, None, 1.6
"""
SUITE = """
import subprocess

import vehicle_test_suite


class AutoTestCopter:
    def __init__(self, binary, speedup, logs_dir):
        self.binary = binary

    def tests(self):
        return [self.Help, self.Wrong, vehicle_test_suite.Test(self.Ends), self.Gripper, self.Last]

    def run_tests(self, tests):
        for test in tests:
            self.run_one_test(test)

    def run_one_test(self, test):
        try:
            test.function()
        except ValueError as error:
            return vehicle_test_suite.Result(error)
        return vehicle_test_suite.Result(None)

    def Help(self):
        subprocess.run([self.binary, "--help"], check=True, capture_output=True)

    def Wrong(self):
        raise ValueError("the first line\\nand a second")

    def Ends(self):
        raise KeyError("the suite")

    def Gripper(self):
        pass

    def Last(self):
        pass
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    folder = tmp_path / "checkout" / "Tools" / "autotest"
    folder.mkdir(parents=True)
    (folder / "arducopter.py").write_text(SUITE)
    (folder / "vehicle_test_suite.py").write_text(FRAMEWORK)
    return tmp_path / "checkout"


@pytest.mark.long
def test_outcomes_of_a_suite(checkout: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(checkout), "--out", str(tmp_path / "out")]) == 1
    written = (tmp_path / "out" / "table.md").read_text()
    assert written in capsys.readouterr().out
    assert ": 2 passed, 2 failed, 1 not applicable" in written
    rows = [tuple(map(str.strip, line.split("|")[1:-1])) for line in written.splitlines()[4:]]
    assert rows == [
        ("Help", "passed", ""),
        ("Wrong", "failed", "the first line"),
        ("Ends", "failed", "KeyError('the suite')"),
        ("Last", "passed", ""),
        ("Gripper", "not applicable", "payload, mount, camera, serial, ESC, CAN, generator or button"),
    ]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["nowhere"], 'checkout "nowhere" has no Tools/autotest/arducopter.py'),
        (["CHECKOUT", "Halp"], 'unknown test "Halp" (did you mean "Help"?)'),
        (["CHECKOUT", "--python", "no-python"], '--python "no-python": No such file'),
        (["CHECKOUT", "--feedback", "none"], "--feedback"),
    ],
)
def test_bad_input_is_refused(
    given: list[str], said: str, checkout: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [str(checkout) if word == "CHECKOUT" else word for word in given]
    with pytest.raises(SystemExit) as ended:
        main([*arguments, "--out", str(tmp_path / "out")])
    assert ended.value.code == 2
    assert said in capsys.readouterr().err


def test_command_line_of_arducopter(tmp_path: Path) -> None:
    file = tmp_path / "copter.parm"
    file.write_text("FRAME_CLASS 1\nSIM_SPEEDUP, 100 # quick\n\nMOT_THST_HOVER\t0.39\nNO_SUCH 3\n")
    line = f"-w -I 1 --home -35.36,149.16,584,270 --model + --serial1=tcp:2 --defaults {file}"
    args = vehicle.parser().parse_args(line.split())
    params = vehicle.defaults(args.defaults)
    assert params == {"FRAME_CLASS": 1, "SIM_SPEEDUP": 100.0, "MOT_THST_HOVER": 0.39}
    autopilot, plant, radio_port = vehicle.specs(args, params)
    assert autopilot.gcs == ("tcpin:127.0.0.1:5770", "tcpin:127.0.0.1:5772")
    assert (autopilot.identity, autopilot.feedback, autopilot.system_id) == ("ardupilot", Feedback.STATE, 2)
    assert (plant.home, plant.start["psi"], radio_port) == (args.home, -180.0, 5511)
