"""Slow estimate of the vehicle's mass from the disturbance along the thrust.

A wrong mass acts in proportion to the thrust. The specific thrust κ, in parts of the nominal one, integrates the
disturbance d along body z, and d loses that part:

    κ' = rate (d z_b) / (T / m_nominal),  d' = -κ' T / m_nominal z_b,  m = m_nominal / κ

For a disturbance by the mass alone this is a lag at any thrust: κ' = rate (κ_true - κ).
"""

from typing import Annotated, NamedTuple

import msgspec

from colibri.common.config import NotNegative, Table
from colibri.common.jit import compiled
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_LEAST_THRUST = 0.5  # least thrust counted, in parts of the nominal weight: a smaller one reveals little of the mass


class MassSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The estimate of the mass."""

    rate_1_s: NotNegative
    """0: the nominal mass is kept."""
    min_ratio: Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]
    """Smallest mass estimate / nominal mass; `max_ratio`: the largest."""
    max_ratio: Annotated[float, msgspec.Meta(ge=1.0)]


class MassModel(NamedTuple):
    nominal_kg: float
    least_thrust_n: float
    rate_1_s: float  # 0: the nominal mass is kept
    min_specific: float  # in parts of the nominal one
    max_specific: float  # in parts of the nominal one
    interval_s: float


def mass_model(settings: MassSettings, vehicle: Vehicle, interval_s: float) -> MassModel:
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
def follow_mass(mass_kg: float, disturbance_m_s2: Array, up: Array, thrust_n: float, model: MassModel) -> float:
    """Return the next mass in flight; `disturbance_m_s2`, ENU, (3,), loses the part that it explains."""
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
