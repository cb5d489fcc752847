"""How a process loads, and how it ends."""

import gc
import subprocess
import sys

import pytest

from colibri.common.process.lifecycle import loading

PROGRAM = """
import atexit, gc
from colibri.common.process.lifecycle import end_quickly

atexit.register(lambda: print(gc.get_freeze_count() > 0))
end_quickly()
print(gc.get_freeze_count() > 0)
"""


def test_what_is_loaded_is_not_looked_through_at_the_end() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


@pytest.mark.parametrize("enabled", [True, False])
def test_no_garbage_is_looked_for_while_loading_and_afterwards_as_before(*, enabled: bool) -> None:
    (gc.enable if enabled else gc.disable)()
    try:
        with loading():
            assert not gc.isenabled()
        assert gc.isenabled() is enabled
    finally:
        gc.enable()
