"""The vehicle as a law models it: allocation, rotor lag, battery, airframe, the disturbance observed."""
