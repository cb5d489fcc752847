import gc
import subprocess
import sys
from weakref import ref

import pytest

from colibri.common.process.lifecycle import freeze_once, gc_frozen, loading

PROGRAM = """
import atexit, gc
from colibri.common.process.lifecycle import end_quickly, loading

atexit.register(lambda: print(gc.get_freeze_count() > 0))
end_quickly()
print(gc.get_freeze_count() > 0)
with loading():
    kept = [[]]
print(any(each is kept for each in gc.get_objects(generation=2)))
"""


def test_loaded_objects_are_old_at_once_and_not_looked_through_at_the_end() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True", "True"]


@pytest.mark.parametrize("enabled", [True, False])
def test_garbage_collection_pauses_while_loading(*, enabled: bool) -> None:
    (gc.enable if enabled else gc.disable)()
    try:
        with loading():
            assert not gc.isenabled()
        assert gc.isenabled() is enabled
    finally:
        gc.enable()


def test_what_somebody_else_has_frozen_stays_frozen() -> None:
    frozen = gc.get_freeze_count()
    assert frozen > 0, "the tests themselves are"
    with gc_frozen():
        assert gc.get_freeze_count() <= frozen  # what is freed is counted no more
    assert 0 < gc.get_freeze_count() <= frozen


def test_garbage_of_a_flight_is_collected_at_the_next() -> None:
    class Flown:
        def __init__(self) -> None:
            self.itself = self

    flown = ref(Flown())
    freeze_once()
    assert flown() is None
