"""References within limits: missions, tasks, tracks, slews."""
