"""Write a control law, and compare two of its gains in a flight.

Prints:
    pull 2.0: 0.287 m
    pull 8.0: 0.083 m
"""

import numpy as np

import colibri


class Spring:
    """Accelerate towards the reference like a damped spring, and tilt the thrust accordingly."""

    control_interval_us = 10_000
    preview = colibri.Preview(interval_us=10_000, samples=1)

    def __init__(self, settings, vehicle, clock):
        self.pull = settings.get("pull", 2.0)
        self.body, self.gravity, self.mixer = vehicle.body, vehicle.gravity_m_s2, colibri.Mixer(vehicle)

    def initial(self, rotor_speed):
        return None

    def step(self, memory, time_us, state, references):
        speed = np.array(state.velocity_enu_m_s) - references.velocity_enu_m_s[0]
        ax, ay, az = self.pull * (references.position_enu_m[0] - state.position_enu_m) - 2.5 * speed
        roll, pitch = np.clip([-ay / self.gravity, ax / self.gravity], -0.5, 0.5)  # holds for a heading of zero
        wanted = np.array([roll, pitch, 0.0])
        turn = 100.0 * (wanted - state.euler) - 18.0 * np.array(state.rate_flu_rad_s)
        wrench = np.array([self.body.mass_kg * (self.gravity + az), *(turn * self.body.inertia_kg_m2)])
        return None, colibri.Decision(rotor_speeds=self.mixer.rotor_speeds(wrench), attitude_reference=tuple(wanted))


for pull in (2.0, 8.0):
    profile = colibri.load_profile("flight").replace("controllers.Spring", {"pull": pull})
    flight = colibri.fly("lemniscate:lap=20", controller=Spring, profile=profile, duration=25)
    print(f"pull {pull}: {flight.report['rmse_after_20s_m']:.3f} m")
