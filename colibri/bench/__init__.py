"""How fast it flies: each stage of a control step, flights at several rates, ground stations served."""
