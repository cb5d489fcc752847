"""Tables and pure rules of modes, arming and failsafes."""
