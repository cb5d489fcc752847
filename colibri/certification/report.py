"""`colibri certify`: certify a profile's law, fly it, and print a table."""

from argparse import Namespace
from math import log

import numpy as np
from scipy.linalg import eigh

from colibri.analysis.tables import print_table, write_table
from colibri.autopilot.control.profile import Profile, load_profile
from colibri.certification import certificate as certificates
from colibri.certification.attitude import ANGLES, RATES
from colibri.certification.certificate import Certificate, NotCertifiedError, ProofEntry
from colibri.certification.figure import draw
from colibri.certification.flights import AttitudeLaw, BorderFlights, CertifiedConditions, FlownErrors, fly
from colibri.certification.planned_attitude import PlannedAttitude
from colibri.common.errors import Error
from colibri.common.process.lifecycle import EXIT_FAILED, fail
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle, load_vehicle

CERTIFICATE, TABLE, FIGURE = "certificate.json", "certificate", "certificate.png"
LAW = "lpv-mpc"
_DURATION_S = 1.0
_STATES = 12
_SEEN = 1e-12
"""Smallest eigenvalue of a weight over its largest that counts."""
_NOT_PROVEN = (
    "limits that bind",
    "references that move",
    "the observers of disturbance and mass",
    "the position loop",
    "the estimator",
    "delay",
    "a vehicle unlike the model (drag, inertia, lag)",
)


class UncertifiableError(Error):
    """A profile whose law cannot be certified."""


def certify_profile(args: Namespace) -> int:
    try:
        profile = load_profile(args.profile).with_choices(args.controller, None)
        vehicle = load_vehicle(args.vehicle or profile.simulation.vehicle)
        law = law_of(profile, vehicle, CertifiedConditions(args.moment, args.charge))
    except Error as error:
        fail(str(error))
    for stale in (CERTIFICATE, FIGURE):
        (args.out / stale).unlink(missing_ok=True)
    try:
        found = certificates.certify(law, args.least, lambda what: None if args.quiet else _say(what))
    except NotCertifiedError as error:
        fail(f"{profile.where} on {vehicle.name}: refused: {error}", EXIT_FAILED)
    flown = fly(law, found.invariant, BorderFlights(args.flights, _DURATION_S, args.seed))
    not_proven = (*law.not_proven, *_NOT_PROVEN)
    about = {
        "law": f"{law.what}, {profile.where}",
        "vehicle": vehicle.name,
        **law.conditions._asdict(),
        "thrust_n": law.thrusts_n(found.invariant.scale),
        "not_proven": not_proven,
    }
    certificates.write(found, about, args.out / CERTIFICATE)
    headings, rows = ("result", f"{', '.join(law.axes)} (deg)", "p, q, r (rad/s)", ""), table(found, law, flown)
    write_table(args.out / TABLE, headings, rows, names=1)
    draw(found, flown, law.axes, args.out / FIGURE)
    largest = float(flown.values[1:].max())
    if not args.quiet:
        print_table(f"{profile.name} on {vehicle.name}: {law.what}", headings, rows, names=1)
        _say(f"{args.flights} flights from its border, as disturbed as allowed: V, there 1, is at most {largest:.3f}")
        _say(f"Not proven: {', '.join(not_proven)}.")
    if largest > 1.0:
        fail(f"{profile.where} on {vehicle.name}: a flight left the set, V = {largest:.4f}", EXIT_FAILED)
    return 0


def law_of(profile: Profile, vehicle: Vehicle, conditions: CertifiedConditions) -> AttitudeLaw:
    name = profile.controller
    if name != LAW:
        raise UncertifiableError(f"{profile.where}: {name} cannot be certified: only {LAW} can")
    if not profile.table(name):
        raise UncertifiableError(f"{profile.where}: has no numbers for {name}")
    return PlannedAttitude(profile.table(name), vehicle, conditions)


def table(found: Certificate, law: AttitudeLaw, flown: FlownErrors) -> list[tuple[str, ...]]:
    _, decay, invariant, attractor, terminal = found
    held = np.degrees(law.held(invariant))
    rate = -log(decay.proof.ratio) / (2.0 * decay.numbers.interval_s)
    least, most = law.thrusts_n(invariant.scale)
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
        ("held attitude", f"{held[0]:.1f}, {held[1]:.1f}, any", "0", ""),
        _reach("ultimate bound, in proportion to the moment", attractor, f"{attractor.numbers.disturbance_n_m:g} N m"),
        ("terminal weight", "", "", f"{weights.min():.2f} to {weights.max():.3g} times the profile's"),
        ("flights: V after the start", "", "", f"at most {flown.values[1:].max():.3f}"),
        ("flights: command beyond the gain", "", "", f"at most {flown.beyond_n_m.max():.2g} N m"),
        ("exact check", "", "", f"least margin {margin:.1g}"),
    ]


def _relative(weight: Array, other: Array) -> Array:
    values, vectors = np.linalg.eigh(other)
    seen = vectors[:, values > _SEEN * values[-1]]
    found: Array = eigh(seen.T @ weight @ seen, seen.T @ other @ seen, eigvals_only=True)
    return found


def _ranges(what: str, entry: ProofEntry, law: AttitudeLaw) -> tuple[str, ...]:
    rates = ", ".join(f"{rate:.2f}" for rate in entry.numbers.rates_rad_s)
    return what, law.ranges(entry.numbers), rates, f"{entry.scale:.3f} of the profile's"


def _reach(what: str, entry: ProofEntry, how: str = "") -> tuple[str, ...]:
    return what, *_triples(entry.proof.reach(np.eye(_STATES))), how


def _triples(states: Array) -> tuple[str, str]:
    angles, rates = np.degrees(states[list(ANGLES)]), states[list(RATES)]
    return ", ".join(f"{value:.2f}" for value in angles), ", ".join(f"{value:.2f}" for value in rates)


def _say(line: str) -> None:
    print(line)  # noqa: T201
