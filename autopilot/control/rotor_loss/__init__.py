"""A lost rotor: detected, and flown down on the other three."""
