"""Each sensor that the filter fuses as it comes, a file: what it tells, its Jacobian, variance, gate and health."""
