"""The tables that decide, and the pure rules over them: modes, arming, failsafes."""
