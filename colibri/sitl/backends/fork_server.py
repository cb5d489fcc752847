"""A process that loads plant and autopilot, then forks one or the other on request.

A request is a line of JSON on standard input: ["start", package, output file, specification], ["code", process id] or
["kill", process id]. The answer is a line: the process id, its exit code, or null.
"""

import gc
import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from colibri.autopilot.spec import AutopilotSpec
from colibri.common.process.lifecycle import use_one_thread
from colibri.common.spec import from_json
from colibri.flights.launcher import Child
from colibri.plant.spec import PlantSpec

_FLIGHTS = ({"feedback": "state"}, {"feedback": "sensors", "turbulence": "light"})


def main() -> None:
    use_one_thread()
    _load()
    gc.collect()
    gc.freeze()
    children: dict[int, Child] = {}
    for line in sys.stdin:
        what, first, *rest = json.loads(line)
        if what == "start":
            kind: type[PlantSpec | AutopilotSpec] = PlantSpec if first == "plant" else AutopilotSpec
            log, text = rest
            child = Child(from_json(kind, text.encode()), fork=True, log=Path(log))
            children[child.number] = child
            answer: int | None = child.number
        else:
            child = children[int(first)]
            if what == "kill":
                child.kill()
            answer = child.code()
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()
    for child in children.values():
        child.kill()


def _load() -> None:
    from colibri.sitl.backends.lockstep_session import LockstepSession
    from colibri.sitl.backends.memory import MemoryAutopilot, MemoryPlant
    from colibri.sitl.backends.setting import setting_of

    with TemporaryDirectory(prefix="sitl-") as folder:
        for flight in _FLIGHTS:
            setting = setting_of([flight])
            autopilot = MemoryAutopilot(setting.autopilot_spec(Path(folder)))
            lockstep = LockstepSession(MemoryPlant(setting.plant_spec()), autopilot, setting.system, setting.rotors)
            lockstep.advance(())
            autopilot.close()


if __name__ == "__main__":
    main()
