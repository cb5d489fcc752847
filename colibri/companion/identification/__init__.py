"""How body rates follow their commands: small steps in flight, a lag fitted to them, a figure."""
