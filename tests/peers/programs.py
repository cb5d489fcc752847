"""Where the real stacks are, and how they run alone: both bind to all addresses."""

import os
from pathlib import Path
from subprocess import DEVNULL, run

import pytest

PROGRAMS = {"px4": "COLIBRI_PX4", "ardupilot": "COLIBRI_ARDUCOPTER"}
ALONE = ("unshare", "--map-root-user", "--net", "sh", "-c", 'ip link set lo up && exec "$0" "$@"')


def can_be_alone() -> bool:
    try:
        return run([*ALONE, "true"], stdout=DEVNULL, stderr=DEVNULL, check=False).returncode == 0
    except OSError:
        return False


def program_of(whom: str) -> Path:
    """Return the program that an environment variable names, alone; without a name, skip the test."""
    path = os.environ.get(PROGRAMS[whom])
    if not path:
        pytest.skip(f"{PROGRAMS[whom]} is not set: the path of {whom}")
    if not can_be_alone():
        pytest.fail(f"unshare --map-root-user --net is not permitted: {whom} would not be alone on its ports")
    return Path(path)
