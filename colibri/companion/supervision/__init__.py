"""Whether a companion may fly, and when it must not any more: checks, limits, and the table of its phases."""
