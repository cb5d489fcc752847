"""The golden flights as on other computers: libraries and kernels chosen for other CPUs, hashes compared."""
