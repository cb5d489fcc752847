"""The same verdict every time, on however slow a machine and from whatever shell."""

import gc
import signal
import threading
from collections.abc import Generator
from importlib import import_module

import pytest
from hypothesis import settings

from colibri.common.process.lifecycle import freeze_once, use_one_thread

settings.register_profile("same-verdict", max_examples=50, deadline=None, derandomize=True, print_blob=True)
settings.load_profile("same-verdict")

gc.set_threshold(20_000, 20, 20)
use_one_thread()  # before numpy is loaded: two workers have a core each

# A shell's background job ignores Ctrl-C, one of nohup hang-ups, and so would every process that a test starts.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_collection_finish() -> None:
    """Keep the garbage collector from what five thousand tests load: it would look at it again and again."""
    import_module("colibri.analysis.figures")  # with the true ready_to_fork: two processes would copy what is collected
    # Flights over UDP fork, as those of users do, beside the waiting threads of pytest-xdist and jemalloc.
    patch, forks = pytest.MonkeyPatch(), import_module("tests.support.forks")
    patch.setattr("colibri.flights.launcher.ready_to_fork", lambda: threading.active_count() == 1)
    patch.setattr("colibri.flights.fleet.Child", forks.forked_child)
    patch.setattr("colibri.mavlink.links.udp.SPIN_S", 0.0)  # the tests beside them need the cores
    patch.setattr("tools.harness.processes.subprocess", forks.FORKS)
    gc.collect()
    freeze_once()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None, object, object]:
    """Keep it from what the tests of a file have loaded, too."""
    done = yield
    if nextitem is None or nextitem.path != item.path:
        gc.collect()
        gc.freeze()
    return done
