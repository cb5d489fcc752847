"""What a law believes of the vehicle: allocation, rotor lag, battery, airframe, the disturbance observed."""
