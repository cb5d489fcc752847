"""References within limits: position chain, attitude slew, landing detection, tracks, missions, tasks."""
