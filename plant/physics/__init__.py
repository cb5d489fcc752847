"""The equations of motion as one function, their integrators, and the world they advance."""
