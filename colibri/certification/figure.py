"""Figure of a certificate: its sets, and flights from the border of one."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from colibri.certification.attitude import PHI, PSI, THETA, P, R
from colibri.certification.certificate import Certificate
from colibri.certification.flights import FlownErrors
from colibri.certification.loop import AnyArray
from colibri.common.types import Array

_SHOWN = 60
_POINTS = 181
_RATE_NAMES = {P: "p (rad/s)", R: "r (rad/s)"}


def draw(certificate: Certificate, flown: FlownErrors, axes_names: tuple[str, ...], path: Path) -> None:
    errors = zip((PHI, THETA, PSI), axes_names, strict=True)
    names = _RATE_NAMES | {state: f"error {name} (deg)" for state, name in errors}
    figure = Figure(figsize=(8.6, 6.9), layout="constrained")
    axes = figure.subplots(2, 2)
    for ax, pair in zip(axes.flat, ((PHI, P), (PHI, THETA), (PSI, R)), strict=False):
        _draw_sets(ax, certificate, flown, *pair)
        ax.set(xlabel=names[pair[0]], ylabel=names[pair[1]])
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2, fontsize=8, frameon=False)
    _draw_values(axes[1, 1], certificate, flown)
    figure.savefig(path, dpi=150)


def _draw_sets(ax: Axes, certificate: Certificate, flown: FlownErrors, across: int, up: int) -> None:
    units = np.array([_unit(across), _unit(up)])
    shown = flown.states[:, :_SHOWN][:, :, [across, up]] * units
    never_left, tended_to = (np.linalg.inv(each.proof.P) for each in (certificate.invariant, certificate.attractor))
    plane = np.ix_([across, up], [across, up])
    at_rest = np.linalg.inv(certificate.invariant.proof.P[plane])
    for shape, color, style, label in (
        (never_left[plane], "#0072B2", "-", "invariant set: its projection"),
        (at_rest, "#0072B2", "--", "its section: no other error"),
        (tended_to[plane], "#D55E00", "-", "ultimate bound"),
    ):
        border = _border(shape) * units[:, None]
        ax.plot(*border, color=color, linestyle=style, linewidth=1.6, label=label, zorder=3)
    ax.plot(shown[:, 0, 0], shown[:, 0, 1], color="#999999", linewidth=0.7, label=f"{shown.shape[1]} of the flights")
    ax.plot(shown[:, 1:, 0], shown[:, 1:, 1], color="#999999", linewidth=0.4)
    ax.plot(shown[0, :, 0], shown[0, :, 1], ".", color="#444444", markersize=3, label="their starts: V = 1")
    ax.grid(color="#DDDDDD", linewidth=0.6)


def _draw_values(ax: Axes, certificate: Certificate, flown: FlownErrors) -> None:
    times = np.arange(len(flown.values)) * certificate.invariant.numbers.interval_s
    ax.semilogy(times, flown.values.max(axis=1), color="black", label=f"largest of {flown.values.shape[1]} flights")
    ax.semilogy(times, np.median(flown.values, axis=1), color="#999999", label="median")
    ax.axhline(1.0, color="black", linewidth=0.8, linestyle="--")
    ax.set(xlabel="time (s)", ylabel="V, 1 on the border")
    ax.grid(color="#DDDDDD", linewidth=0.6)
    ax.legend(loc="upper right", bbox_to_anchor=(1.0, 0.95), fontsize=8)


def _border(shape: AnyArray) -> Array:
    """Return the border, (2, n), of xᵀ shape⁻¹ x <= 1."""
    angles = np.linspace(0.0, 2.0 * np.pi, _POINTS)
    border: Array = np.linalg.cholesky(shape) @ np.array([np.cos(angles), np.sin(angles)])
    return border


def _unit(state: int) -> float:
    return 180.0 / np.pi if state in (PHI, THETA, PSI) else 1.0
