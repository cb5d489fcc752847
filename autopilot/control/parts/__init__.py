"""Parts that several control laws are made of."""
