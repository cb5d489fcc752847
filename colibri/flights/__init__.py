"""A planned flight and how it is flown: in this process, as two, as a fleet, or again from its log."""
