"""Position error dynamics: a double integrator with placed poles."""


def gains(poles: tuple[float, float]) -> tuple[float, float]:
    """Return the gains on an error, 1/s², and on its rate, 1/s, for two poles, 1/s."""
    first, second = poles
    return first * second, -(first + second)
