"""Files of profiles and vehicles: Colibri's own, and a vehicle as parameters of other autopilots."""
