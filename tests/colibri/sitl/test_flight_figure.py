import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from colibri.sitl.flight_record import _draw_place


def test_neither_the_legend_nor_another_curve_covers_a_curve() -> None:
    t = np.linspace(0.0, 4.0, 50)
    figure = Figure(figsize=(8.5, 3.5))
    axes = figure.subplots()
    _draw_place(axes, {"t": t, "x": t, "y": t, "z": np.full(50, 5.0)}, 4.0)
    FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    legend = axes.get_legend()
    assert legend is not None
    bottom_px = legend.get_window_extent().y0
    assert axes.transData.transform((0.0, 5.0))[1] < bottom_px
    widths = [line.get_linewidth() for line in axes.lines]
    assert widths == sorted(widths, reverse=True)
    assert len(set(widths)) == 3
