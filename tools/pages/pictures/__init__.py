"""Pictures of docs/ that stand alone: a flight that moves, and the page of `colibri view`."""
