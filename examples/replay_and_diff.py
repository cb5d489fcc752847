"""Record a flight, replay it bit for bit, and find where a flight on a heavier vehicle leaves it.

Prints:
    replayed: 0
    same flight, same hash: True
    with a payload: equal until 5.000 s, then 0.004 m apart at most
"""

import shutil
import subprocess
import sys

import numpy as np

import colibri

options = {"track": "lemniscate:lap=8", "duration": 8, "turbulence": "light", "seed": 5}
shutil.rmtree("out/replay", ignore_errors=True)
colibri.fly(**options).save("out/replay")
done = subprocess.run([sys.executable, "-m", "colibri", "replay", "--quiet", "out/replay"], check=False)
print("replayed:", done.returncode)
before, after = colibri.load_flight("out/replay"), colibri.fly(**options, events=["5:payload=0.05"])
print("same flight, same hash:", before.sha256 == colibri.fly(**options).sha256)
apart_m = np.linalg.norm([before.samples[axis] - after.samples[axis] for axis in "xyz"], axis=0)
begin_s = before.samples["t"][np.flatnonzero(apart_m)[0] - 1]
print(f"with a payload: equal until {begin_s:.3f} s, then {apart_m.max():.3f} m apart at most")
