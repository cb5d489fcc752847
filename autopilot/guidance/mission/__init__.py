"""A mission flown: item rules, legs, executor, geofence."""
