"""Wind, gusts, turbulence, and the streams of random numbers."""
