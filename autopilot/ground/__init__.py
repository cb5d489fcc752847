"""The vehicle as ground stations see it: services on one hub, snapshots, battery, injected faults."""
