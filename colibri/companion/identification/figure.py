"""Plot measured and modelled body rates of an identification."""

from pathlib import Path

from matplotlib.figure import Figure

from colibri.companion.identification.fit import Fit

_AXES = ("p", "q", "r")


def draw(fit: Fit, path: Path) -> None:
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    t = fit.grid_s - fit.grid_s[0]
    for axis, (name, plot) in enumerate(zip(_AXES, figure.subplots(3, 1, sharex=True), strict=True)):
        plot.plot(t, fit.measured[:, axis], label="measured", linewidth=1.0)
        plot.plot(t, fit.modelled[:, axis], label=f"lag of order {fit.order}", linewidth=1.0)
        lag_ms, explained = 1e3 * fit.time_constant_s[axis], 100.0 * fit.explained[axis]
        plot.set_title(f"{name}: {lag_ms:.0f} ms, after {1e3 * fit.latency_s:.0f} ms; {explained:.0f} % explained")
        plot.set_ylabel("rad/s")
        plot.grid(alpha=0.3)
    figure.axes[0].legend(loc="upper right")
    figure.axes[-1].set_xlabel("s")
    figure.savefig(path, dpi=110)
