"""`colibri certify`: a profile's law certified, flown from the border of its set, and told as a table."""

from argparse import Namespace
from math import log

import numpy as np
from scipy.linalg import eigh

from colibri.analysis.tables import print_table, write_table
from colibri.autopilot.control.lpv_mpc.prediction import ANGLES, PHI, RATES, THETA
from colibri.autopilot.control.profile import load_profile
from colibri.certification import certificate as certificates
from colibri.certification.attitude import attitude_loop
from colibri.certification.certificate import Certificate, Entry, RefusedError
from colibri.certification.figure import draw
from colibri.certification.flights import Flown, fly
from colibri.certification.lqr_attitude import LAW, Conditions, LqrAttitude
from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_FAILED, fail
from colibri.common.types import Array
from colibri.plant.vehicle.description import load_vehicle

CERTIFICATE, TABLE, FIGURE = "certificate.json", "certificate", "certificate.png"
_DURATION_S = 1.0
_STATES = 12
_SEEN = 1e-12
"""Part of its largest eigenvalue above which a weight is not zero."""
_HEADINGS = ("what", "φ, θ, ψ (deg)", "p, q, r (rad/s)", "")
_NOT_PROVEN = (
    "the gain of the plan itself",
    "limits that bind",
    "references that move",
    "the observers of disturbance and mass",
    "the position loop",
    "the estimator",
    "delay",
    "a vehicle unlike the model (rotors' spin-up torque and drag, inertia, lag)",
    "other laws (whole-lpv-mpc)",
)


def certify_profile(args: Namespace) -> int:
    """Certify as the command line says; return the exit code: 0 where all is proven."""
    try:
        profile = load_profile(args.profile)
        vehicle = load_vehicle(args.vehicle or profile.simulation.vehicle)
        law = LqrAttitude(profile, vehicle, Conditions(args.moment, args.charge))
    except Error as error:
        fail(str(error))
    for stale in (CERTIFICATE, FIGURE):
        (args.out / stale).unlink(missing_ok=True)
    try:
        found = certificates.certify(law, args.least, lambda what: None if args.quiet else _say(what))
    except RefusedError as error:
        fail(f"{profile.where} on {vehicle.name}: refused: {error}", EXIT_FAILED)
    flown = fly_from(found, args.flights, args.seed)
    about = {
        "law": f"LQR of the attitude of {LAW}, {profile.where}",
        "vehicle": vehicle.name,
        **law.conditions._asdict(),
        "thrust_n": law.thrusts_n(found.invariant.scale),
        "not_proven": _NOT_PROVEN,
    }
    certificates.write(found, about, args.out / CERTIFICATE)
    rows = table(found, law)
    write_table(args.out / TABLE, _HEADINGS, rows, names=1)
    draw(found, flown, args.out / FIGURE)
    largest = float(flown.values[1:].max())
    if not args.quiet:
        print_table(f"{profile.name} on {vehicle.name}: LQR of the attitude of {LAW}", _HEADINGS, rows, names=1)
        _say(f"{args.flights} flights from its border, as disturbed as allowed: V, there 1, is at most {largest:.3f}")
        _say(f"Not proven: {', '.join(_NOT_PROVEN)}.")
    if largest > 1.0:
        fail(f"{profile.where} on {vehicle.name}: a flight left the set, V = {largest:.4f}", EXIT_FAILED)
    return 0


def fly_from(found: Certificate, flights: int, seed: int) -> Flown:
    """Fly from the border of the invariant set, towards any attitude that may be held."""
    entry = found.invariant
    return fly(entry.numbers, entry.proof, attitudes_held(found), flights, _DURATION_S, seed)


def attitudes_held(found: Certificate) -> Array:
    """Return the largest constant |phi| and |theta|, rad, (2,), around which the invariant set keeps all limits."""
    limits = np.asarray(attitude_loop(found.invariant.numbers, float).limits, dtype=float)
    room: Array = 1.0 / limits[[0, 1], [PHI, THETA]] - found.invariant.proof.reach(np.eye(_STATES)[[PHI, THETA]])
    return room


def table(found: Certificate, law: LqrAttitude) -> list[tuple[str, ...]]:
    """Return the rows of the certificate's table, under `_HEADINGS`."""
    _, decay, invariant, attractor, terminal = found
    held = np.degrees(attitudes_held(found))
    rate = -log(decay.proof.ratio) / (2.0 * decay.numbers.interval_s)
    least, most = law.thrusts_n(invariant.scale)
    weights = _relative(terminal.proof.P, law.mpc.problem.terminal_weight)
    margin = min(min(entry.margins.values()) for entry in found)
    at_rest = 1.0 / np.sqrt(np.diag(invariant.proof.P))
    return [
        _ranges("largest ranges with a Lyapunov function", found.largest),
        _ranges("ranges of all that follows", invariant),
        ("thrust", "", "", f"{least:.2f} to {most:.2f} N"),
        ("decay without disturbance", "", "", f"exp(-{rate:.2f} t), t in s"),
        _reach("set that is never left", invariant),
        ("begun with no other error", *_triples(at_rest), ""),
        ("attitude that may be held", f"{held[0]:.1f}, {held[1]:.1f}, any", "0", ""),
        _reach("tended to, in proportion to the moment", attractor, f"{attractor.numbers.disturbance_n_m:g} N m"),
        ("terminal weight", "", "", f"{weights.min():.2f} to {weights.max():.3g} times the profile's"),
        ("exact check", "", "", f"least margin {margin:.1g}"),
    ]


def _relative(weight: Array, other: Array) -> Array:
    """Return the generalised eigenvalues of a weight to another, where the other is not zero, ascending."""
    values, vectors = np.linalg.eigh(other)
    seen = vectors[:, values > _SEEN * values[-1]]
    found: Array = eigh(seen.T @ weight @ seen, seen.T @ other @ seen, eigvals_only=True)
    return found


def _ranges(what: str, entry: Entry) -> tuple[str, ...]:
    phi, theta = np.degrees(2.0 * np.arctan(entry.numbers.half_tangents))
    rates = ", ".join(f"{rate:.2f}" for rate in entry.numbers.rates_rad_s)
    return what, f"{phi:.1f}, {theta:.1f}, any", rates, f"{entry.scale:.3f} of the profile's"


def _reach(what: str, entry: Entry, how: str = "") -> tuple[str, ...]:
    return what, *_triples(entry.proof.reach(np.eye(_STATES))), how


def _triples(states: Array) -> tuple[str, str]:
    angles, rates = np.degrees(states[list(ANGLES)]), states[list(RATES)]
    return ", ".join(f"{value:.2f}" for value in angles), ", ".join(f"{value:.2f}" for value in rates)


def _say(line: str) -> None:
    print(line)  # noqa: T201
