"""What is kept in memory of a flight of any length: what it is judged by, and what its figures show."""
