"""Missions: item rules, legs, executor, geofence."""
