"""What every package may use and nothing here knows a vehicle or MAVLink."""
