"""Each sensor that the filter fuses as it comes, a file: what it measures, its Jacobian, variance, gate and health."""
