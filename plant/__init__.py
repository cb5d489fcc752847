"""The vehicle that flies: its description, its nonlinear dynamics, and the process that integrates them."""
