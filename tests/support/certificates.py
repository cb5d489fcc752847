"""Read a certificate as `colibri certify` writes it."""

from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from colibri.certification.attitude import AttitudeNumbers
from colibri.certification.certificate import Certificate, ProofEntry
from colibri.certification.lyapunov import Proof


def read_certificate(path: Path) -> Certificate:
    entries = msgspec.json.decode(path.read_bytes())
    return Certificate(**{name: _entry(**entries[name]) for name in Certificate._fields})


def _entry(scale: float, numbers: dict[str, Any], proof: dict[str, Any], margins: dict[str, float]) -> ProofEntry:
    P, multipliers, sizes = (np.array(proof[name]) for name in ("P", "multipliers", "sizes"))
    return ProofEntry(scale, AttitudeNumbers(**numbers), Proof(P, multipliers, sizes, proof["ratio"]), margins)
