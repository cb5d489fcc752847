"""The plant as a pure composition: a frame out, a command and faults in."""
