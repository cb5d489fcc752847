"""The vehicle as ground stations see it: all services on one hub, snapshots, forecast, battery, injected faults."""
