"""Parameters from end to end: set by a client that others wrote, kept by the vehicle, read back."""

import json
import subprocess
import sys
from pathlib import Path

from tools.harness.processes import vehicle

NAME = "SYS_AUTOCONFIG"
PROGRAM = "tests.clients.support.int_parameters"
SIGNALLING = [(-8388607, -4194305), (2139095041, 2143289343)]
"""INT32 values whose bits, taken for a float, are those of a signalling NaN."""
VALUES = (
    *(value for first, last in SIGNALLING for value in (first - 1, first, (first + last) // 2, last, last + 1)),
    *(-5000000, -(2**31), 2**31 - 1, -1, 1, 0, 16777217, 0x7F800000, 0x7FC00000, -0x800000),
)


def test_every_integer_survives_the_way_there_and_back(tmp_path: Path) -> None:
    with vehicle(tmp_path) as flown:
        values = [str(value) for value in VALUES]
        command = [sys.executable, "-m", PROGRAM, f"udpout://127.0.0.1:{flown.port}", NAME, *values]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert tuple(json.loads(done.stdout.splitlines()[-1])) == VALUES
        # The last value is kept where it is not the default.
        (kept,) = (flown.state / "0").glob("*.params")
        assert f"{NAME}\t{VALUES[-1]}" in kept.read_text(encoding="utf-8")
