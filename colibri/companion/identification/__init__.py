"""How body rates follow commands: small steps in flight, a lag of first or second order fitted to them, a figure."""
