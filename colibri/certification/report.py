"""`colibri certify`: certify a law, fly it, and report."""

from argparse import Namespace
from math import degrees, log, pi
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.linalg import eigh

from colibri.analysis.tables import print_table, write_table
from colibri.autopilot.control.profile import Profile, load_profile
from colibri.certification import certificate as certificates
from colibri.certification.attitude import (
    ANGLES,
    INPUTS,
    M1,
    PHI,
    PSI,
    RATES,
    STATES,
    THETA,
    CertifiedConditions,
    Momentum,
    P,
    R,
)
from colibri.certification.certificate import Certificate, NotCertifiedError, ProofEntry
from colibri.certification.loop import AnyArray
from colibri.certification.planned_attitude import HELD_RAD, PlanFlyer, PlannedAttitude
from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_FAILED, fail, one_line
from colibri.common.types import Array
from colibri.flights.folder import occupied
from colibri.plant.vehicle.description import Vehicle, load_vehicle

_SUBSTEPS = 4
_RESONANCE_RAD_S = 28.0  # of roll and pitch in profile flight
_KINDS = 4
_INSIDE = 1.0 - 1e-9
_NO_LENGTH = 1e-12


class FlownErrors(NamedTuple):
    """Errors, (steps + 1, flights, 12), V, and largest commands beyond the gain, (3,)."""

    states: Array
    values: Array
    beyond_n_m: Array


class Interval(NamedTuple):
    commands: Array
    disturbance_n_m: Array
    inertia: Array
    lag_s: float
    momentum: Momentum


def fly(law: PlannedAttitude, entry: ProofEntry, flights: int, duration_s: float, *, seed: int) -> FlownErrors:
    """Fly from V = 1 to attitudes that may be held, under moments constant, random, resonant, or the worst for V."""
    numbers, proof = entry.numbers, entry.proof
    rng = np.random.default_rng(seed)
    z = np.linalg.solve(np.linalg.cholesky(proof.P).T, _directions(rng, flights, STATES + INPUTS).T).T * _INSIDE
    held = rng.uniform(-1.0, 1.0, (flights, 2)) * HELD_RAD
    constant, kinds = _directions(rng, flights, INPUTS), np.arange(flights)[:, None] % _KINDS
    inertia, gain = np.array(numbers.inertia_kg_m2), np.array(numbers.commanded[0])
    thrusts_n, headings = rng.uniform(*law.thrusts_n(entry.scale), flights), rng.uniform(-pi, pi, flights)
    flyer, momentum = PlanFlyer(law, np.column_stack([held, headings]), thrusts_n), law.momentum(thrusts_n)
    states, beyond_n_m = [z], np.zeros(INPUTS)
    for step in range(round(duration_s / numbers.interval_s)):
        commands, remembered = flyer.commands(z)
        beyond_n_m = np.maximum(beyond_n_m, np.abs(commands - z @ gain.T).max(axis=0))
        swinging = constant * np.sin(_RESONANCE_RAD_S * numbers.interval_s * step)
        worst = _unit_vectors(z @ proof.P[:, RATES] / inertia)
        disturbance_n_m = numbers.disturbance_n_m * np.choose(
            kinds, [constant, _directions(rng, flights, INPUTS), swinging, worst]
        )
        interval = Interval(commands, disturbance_n_m, inertia, numbers.lag_s, momentum)
        z = np.hstack([integrate(z[:, :STATES], interval, numbers.interval_s), remembered])
        states.append(z)
    flown = np.array(states)
    return FlownErrors(flown, np.einsum("tfi,ij,tfj->tf", flown, proof.P, flown), beyond_n_m)


def integrate(x: Array, interval: Interval, duration_s: float) -> Array:
    dt = duration_s / _SUBSTEPS
    if interval.lag_s == 0.0:
        x = np.hstack([x[:, :M1], interval.commands])
    for _ in range(_SUBSTEPS):
        k1 = _derivative(x, interval)
        k2 = _derivative(x + 0.5 * dt * k1, interval)
        k3 = _derivative(x + 0.5 * dt * k2, interval)
        k4 = _derivative(x + dt * k3, interval)
        x = x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return x


def _derivative(x: Array, interval: Interval) -> Array:
    rate, moment = x[:, RATES], x[:, M1:]
    change = np.zeros_like(x)
    if interval.lag_s:
        change[:, M1:] = (interval.commands - moment) / interval.lag_s
    momentum, spinning = interval.momentum(moment, change[:, M1:])
    carried = interval.inertia * rate
    carried[:, 2] += momentum
    turning = moment + interval.disturbance_n_m - np.cross(rate, carried)
    turning[:, 2] -= spinning
    eta = np.sqrt(1.0 - 0.25 * np.sum(x[:, ANGLES] ** 2, axis=1))
    change[:, ANGLES] = eta[:, None] * rate + 0.5 * np.cross(x[:, ANGLES], rate)
    change[:, RATES] = turning / interval.inertia
    return change


def _directions(rng: np.random.Generator, count: int, size: int) -> Array:
    return _unit_vectors(rng.normal(size=(count, size)))


def _unit_vectors(vectors: Array) -> Array:
    units: Array = vectors / np.maximum(np.linalg.norm(vectors, axis=1), _NO_LENGTH)[:, None]
    return units


_SHOWN = 60
_POINTS = 181
_RATE_NAMES = {P: "p (rad/s)", R: "r (rad/s)"}


def draw(certificate: Certificate, flown: FlownErrors, path: Path) -> None:
    errors = zip((PHI, THETA, PSI), _AXES, strict=True)
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


CERTIFICATE, TABLE, FIGURE = "certificate.json", "certificate", "certificate.png"
LAW = "lpv-mpc"
_DURATION_S = 1.0
_SEEN = 1e-12  # smallest eigenvalue of a weight over its largest that counts
_WHAT, _AXES = f"unconstrained attitude law of {LAW}", ("about x", "about y", "about z")
_NOT_PROVEN = (
    "what its QP commands beyond its gain at rest: of second order in the errors",
    "that the last plan's later corrections count for nothing: for less than a thousandth",
    "that the gain is within its bound between a grid of attitudes and thrusts",
    "a thrust that changes",
    "limits that bind",
    "references that move",
    "the observers of disturbance and mass",
    "the position loop",
    "the estimator",
    "delay",
    "a vehicle unlike the model (drag, inertia, lag)",
)


def certify(args: Namespace) -> int:
    with occupied(args.out):
        return _certify(args)


def _certify(args: Namespace) -> int:
    with one_line():
        profile = load_profile(args.profile).with_choices(args.controller, None)
        vehicle = load_vehicle(args.vehicle or profile.simulation.vehicle)
        law = law_of(profile, vehicle, CertifiedConditions(args.moment, args.charge))
    for stale in (CERTIFICATE, FIGURE):
        (args.out / stale).unlink(missing_ok=True)
    try:
        found = certificates.certify(law.numbers_at, args.least, lambda what: None if args.quiet else _say(what))
    except NotCertifiedError as error:
        fail(f"{profile.where} on {vehicle.name}: refused: {error}", EXIT_FAILED)
    flown = fly(law, found.invariant, args.flights, _DURATION_S, seed=args.seed)
    about = {
        "law": f"{_WHAT}, {profile.where}",
        "vehicle": vehicle.name,
        **law.conditions._asdict(),
        "thrust_n": law.thrusts_n(found.invariant.scale),
        "not_proven": _NOT_PROVEN,
    }
    certificates.write(found, about, args.out / CERTIFICATE)
    headings, rows = ("result", f"{', '.join(_AXES)} (deg)", "p, q, r (rad/s)", ""), table(found, law, flown)
    write_table(args.out / TABLE, headings, rows, names=1)
    draw(found, flown, args.out / FIGURE)
    largest = float(flown.values[1:].max())
    if not args.quiet:
        print_table(f"{profile.name} on {vehicle.name}: {_WHAT}", headings, rows, names=1)
        _say(f"{args.flights} flights from its border, as disturbed as allowed: V, there 1, is at most {largest:.3f}")
        _say(f"Not proven: {', '.join(_NOT_PROVEN)}.")
    if largest > 1.0:
        fail(f"{profile.where} on {vehicle.name}: a flight left the set, V = {largest:.4f}", EXIT_FAILED)
    return 0


def law_of(profile: Profile, vehicle: Vehicle, conditions: CertifiedConditions) -> PlannedAttitude:
    name = profile.controller
    if name != LAW:
        raise Error(f"{profile.where}: {name} cannot be certified: only {LAW} can")
    if not profile.table(name):
        raise Error(f"{profile.where}: has no numbers for {name}")
    return PlannedAttitude(profile.table(name), vehicle, conditions)


def table(found: Certificate, law: PlannedAttitude, flown: FlownErrors) -> list[tuple[str, ...]]:
    _, decay, invariant, attractor, terminal = found
    rate = -log(decay.proof.ratio) / (2.0 * decay.numbers.interval_s)
    (least, most), held_deg = law.thrusts_n(invariant.scale), degrees(HELD_RAD)
    weights = _relative(terminal.proof.P, law.terminal_weight)
    margin = min(min(entry.margins.values()) for entry in found)
    at_rest = 1.0 / np.sqrt(np.diag(invariant.proof.P))
    return [
        _ranges("largest ranges with a Lyapunov function", found.largest, law),
        _ranges("ranges of all further proofs", invariant, law),
        ("thrust", "", "", f"{least:.2f} to {most:.2f} N"),
        ("decay without disturbance", "", "", f"exp(-{rate:.2f} t), t in s"),
        _reach("invariant set", invariant),
        ("its section: no other error", *_triples(at_rest), ""),
        ("held attitude", f"{held_deg:.1f}, {held_deg:.1f}, any", "0", ""),
        _reach("ultimate bound, in proportion to the moment", attractor, f"{attractor.numbers.disturbance_n_m:g} N m"),
        ("terminal weight", "", "", f"{weights.min():.2f} to {weights.max():.3g} times the profile's"),
        ("flights: V after the start", "", "", f"at most {flown.values[1:].max():.3f}"),
        ("flights: command beyond the gain", "", "", f"at most {flown.beyond_n_m.max():.2g} N m"),
        ("exact check", "", "", f"least margin {margin:.1g}"),
    ]


def _relative(weight: Array, other: Array) -> Array:
    values, vectors = np.linalg.eigh(other)
    seen = vectors[:, values > _SEEN * values[-1]]
    return eigh(seen.T @ weight @ seen, seen.T @ other @ seen, eigvals_only=True)


def _ranges(what: str, entry: ProofEntry, law: PlannedAttitude) -> tuple[str, ...]:
    rates = ", ".join(f"{rate:.2f}" for rate in entry.numbers.rates_rad_s)
    return what, law.ranges(entry.numbers), rates, f"{entry.scale:.3f} of the profile's"


def _reach(what: str, entry: ProofEntry, how: str = "") -> tuple[str, ...]:
    return what, *_triples(entry.proof.reach(np.eye(STATES + INPUTS))), how


def _triples(states: Array) -> tuple[str, str]:
    angles, rates = np.degrees(states[ANGLES]), states[RATES]
    return ", ".join(f"{value:.2f}" for value in angles), ", ".join(f"{value:.2f}" for value in rates)


def _say(line: str) -> None:
    print(line)  # noqa: T201
