"""ArduPilot's own tests, flown on Colibri: a judge from outside."""
