"""The vehicle as ground stations see it."""
