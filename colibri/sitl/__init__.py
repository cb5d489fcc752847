"""Flight tests in pytest: a vehicle, its plant, its ground stations and the links between, all in simulated time."""
