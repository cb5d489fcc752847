"""Fly a heavier vehicle, once known to the autopilot and once known to the plant only.

Prints:
    known: 35.1 mm at most, lost: None
    plant only: 36.8 mm at most, lost: None
"""

import colibri

heavier = (
    colibri.load_vehicle("hummingbird")
    .replace("name", "Hummingbird with a camera")
    .replace("body.mass_kg", 0.85)
    .replace("body.inertia_kg_m2", [0.0038, 0.0038, 0.0066])
)
flights = {
    "known": colibri.fly("spiral", vehicle=heavier, duration=12),
    "plant only": colibri.fly("spiral", plant_vehicle=heavier, duration=12),
}
for name, flight in flights.items():
    print(f"{name}: {1000 * flight.report['max_error_m']:.1f} mm at most, lost: {flight.lost}")
