"""How a process ends."""

import subprocess
import sys

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
