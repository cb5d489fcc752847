"""Which numbers of law, vehicle, behaviour and failsafes are parameters, and the law rebuilt when one changes."""
