"""The repository's own scripts; nothing of it is shipped."""
