"""A program of its own: loads what plant and autopilot need, then forks one or the other on request.

A request is a line on standard input, a JSON list: "start", the package, a file for its output, and its options;
"code" or "kill" and a process. The answer is a line on standard output: the process, or its exit code, or null.
"""

import gc
import json
import os
import signal
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from colibri.common.process.lifecycle import use_one_thread
from colibri.flights.forked import fork

_FLIGHTS = ({"feedback": "state"}, {"feedback": "sensors", "turbulence": "light"})


def main() -> None:
    """Serve until standard input ends."""
    use_one_thread()
    _load()
    gc.collect()
    gc.freeze()
    living: set[int] = set()
    for line in sys.stdin:
        what, first, *rest = json.loads(line)
        if what == "start":
            pid = _fork(first, *rest)
            living.add(pid)
            answer: int | None = pid
        else:
            pid = int(first)
            answer = _end(pid) if what == "kill" else _code(pid, os.WNOHANG)
            if answer is not None:
                living.discard(pid)
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()
    for pid in living:
        _end(pid)


def _load() -> None:
    """Load, and run once, all that is compiled."""
    from colibri.sitl.backends.lockstep import LockstepSession
    from colibri.sitl.backends.memory import MemoryAutopilot, MemoryPlant
    from colibri.sitl.backends.setting import setting_of

    with TemporaryDirectory(prefix="sitl-") as folder:
        for flight in _FLIGHTS:
            setting = setting_of([flight])
            autopilot = MemoryAutopilot(setting.autopilot_options(Path(folder)))
            lockstep = LockstepSession(MemoryPlant(setting.plant_options(0.0)), autopilot, setting.system)
            lockstep.advance(())
            autopilot.close()


def _fork(package: str, log: str, *options: str) -> int:
    out = os.open(log, os.O_WRONLY | os.O_APPEND)
    try:
        return fork(package, options, out, out)
    finally:
        os.close(out)


def _code(pid: int, options: int) -> int | None:
    ended, status = os.waitpid(pid, options)
    return os.waitstatus_to_exitcode(status) if ended else None


def _end(pid: int) -> int | None:
    os.kill(pid, signal.SIGKILL)
    return _code(pid, 0)


if __name__ == "__main__":
    main()
