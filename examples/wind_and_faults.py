"""Let wind, a payload and a weak rotor come as events of one flight, and see the largest error after each.

Prints:
    calm: 0.000 m
    wind: 0.034 m
    payload: 0.006 m
    rotor: 0.004 m
"""

import numpy as np

import colibri

events = [
    "10:wind=6@270",  # 6 m/s from the west
    "15:payload=0.1",  # kg
    {"t": 20, "event": "motor", "rotor": 1, "fraction": 0.9},  # of its thrust
]
flight = colibri.fly("hover:height=3", events=events, duration=25)
samples = flight.samples
error_m = np.linalg.norm([samples["x"], samples["y"], samples["z"] - 3.0], axis=0)
for name, begin_s in {"calm": 5, "wind": 10, "payload": 15, "rotor": 20}.items():
    during = (samples["t"] >= begin_s) & (samples["t"] < begin_s + 5)
    print(f"{name}: {error_m[during].max():.3f} m")
