"""Whether a process may be forked."""

import os
import subprocess
import sys

SCRIPT = """
import _thread, threading, time
import numpy as np
from colibri.flights.launcher import ready_to_fork

square = np.ones((400, 400))
square @ square  # OpenBLAS has begun its threads
answers = [ready_to_fork()]
ended = threading.Event()
threading.Thread(target=ended.wait).start()
answers.append(ready_to_fork())
ended.set()
_thread.start_new_thread(time.sleep, (60,))  # as of a library: Python does not list it
answers.append(ready_to_fork())
print(*answers)
"""


def test_only_openblas_may_have_threads_where_a_process_is_forked() -> None:
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "2"}  # where the tests have one
    ran = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True)
    assert ran.stdout.split() == [str(sys.platform == "linux"), "False", "False"]
    assert not ran.stderr
