"""The repository's own scripts, which are not shipped."""
