"""How body rates follow their commands: small steps in flight, lags of first or second order fitted to them, a figure."""
