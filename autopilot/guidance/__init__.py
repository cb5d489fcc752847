"""References shaped within limits: position chain, attitude slew, landing detection."""
