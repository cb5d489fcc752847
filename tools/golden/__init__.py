"""Golden flights as on other computers."""
