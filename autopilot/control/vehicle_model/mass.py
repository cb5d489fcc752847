"""The mass that a vehicle moves like, followed slowly: what of the observed disturbance lies along the thrust.

A wrong mass shows as an acceleration in proportion to the thrust, which varies as that does, so no observer of a
constant can follow it. Hence the specific thrust κ, in parts of that of the nominal mass, goes where the disturbance d
leads it along the body's z axis; what it then explains is taken out of d:

    κ' = rate (d z_b) / (T / m_nominal),  d' = -κ' T / m_nominal z_b,  m = m_nominal / κ

Where d is of the mass alone this is a lag, κ' = rate (κ_true - κ), at any thrust.
"""

from typing import Annotated, NamedTuple

import msgspec

from colibri.common.config import NotNegative, Table
from colibri.common.jit import Packed, compiled
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_LEAST_THRUST = 0.5
"""In parts of the nominal weight: less thrust tells less of the mass, and counts as this much."""


class MassSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The mass that is followed."""

    rate_1_s: NotNegative
    """0: the nominal mass is kept."""
    min_ratio: Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]
    """Of the mass to the nominal one, and so the largest."""
    max_ratio: Annotated[float, msgspec.Meta(ge=1.0)]


class MassModel(NamedTuple):
    """What stays the same as a mass is followed.

    Attributes:
        nominal_kg: The vehicle's, as its file has it.
        least_thrust_n: Thrust counts as no less.
        rate_1_s: At which specific thrust is followed; 0: the nominal mass is kept.
        min_specific, max_specific: Least and largest specific thrust, in parts of the nominal one.
        interval_s: Between two samples.
    """

    nominal_kg: float
    least_thrust_n: float
    rate_1_s: float
    min_specific: float
    max_specific: float
    interval_s: float


def mass_model(settings: MassSettings, vehicle: Vehicle, interval_s: float) -> MassModel:
    """Return how the mass of `vehicle` is followed every `interval_s`."""
    nominal_kg = vehicle.body.mass_kg
    return MassModel(
        nominal_kg,
        _LEAST_THRUST * nominal_kg * vehicle.gravity_m_s2,
        settings.rate_1_s,
        1.0 / settings.max_ratio,
        1.0 / settings.min_ratio,
        interval_s,
    )


@compiled
def follow_mass(mass_kg: float, disturbance_m_s2: Array, up: Array, thrust_n: float, packed: Packed) -> float:
    """Return the mass, kg, a sample later; to be asked only of a vehicle on which nothing but air and rotors acts.

    `disturbance_m_s2` is the acceleration that the model with this mass does not explain, ENU, (3,); what it would not
    with the mass returned is written back. `up` is the body z axis, ENU, (3,), `packed` the `MassModel`.
    """
    model = packed[0]
    before, specific = model.nominal_kg / mass_kg, 1.0
    if model.rate_1_s > 0.0:
        along = disturbance_m_s2[0] * up[0] + disturbance_m_s2[1] * up[1] + disturbance_m_s2[2] * up[2]
        missed = along * model.nominal_kg / max(thrust_n, model.least_thrust_n)
        specific = before + model.rate_1_s * model.interval_s * missed
        specific = min(max(specific, model.min_specific), model.max_specific)
    for i in range(3):
        disturbance_m_s2[i] -= (specific - before) * thrust_n / model.nominal_kg * up[i]
    followed_kg: float = model.nominal_kg / specific
    return followed_kg
