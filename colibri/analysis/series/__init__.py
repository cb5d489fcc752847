"""A flight of any length in bounded memory, for judging and for figures."""
