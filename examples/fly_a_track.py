"""Fly a lemniscate in wind and turbulence on simulated sensors, and save its figure.

Prints:
    lost: None
    position error, RMS after 20 s: 0.356 m
    hash of the trajectory: e4d77b0582bbb4cd
"""

import colibri

flight = colibri.fly("lemniscate:lap=6", duration=24, feedback="sensors", wind="5@270", turbulence="light", seed=3)
print("lost:", flight.lost)
print(f"position error, RMS after 20 s: {flight.report['rmse_after_20s_m']:.3f} m")
print("hash of the trajectory:", flight.sha256[:16])
flight.plot("error").savefig("fly_a_track.png")
