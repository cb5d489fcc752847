"""How body rates follow their commands: small steps in flight, a first-order lag fitted to them, a figure."""
