"""Raw sensor data: plausibility, inertial samples, clock resets, alignment at rest or in free fall."""
