"""The earth under a vehicle: geodesy, standard atmosphere, magnetic field, home."""
