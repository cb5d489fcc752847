"""Raw sensor data: plausibility, inertial samples, alignment."""
