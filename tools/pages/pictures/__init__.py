"""Pictures of docs/: a moving flight, and `colibri view`."""
