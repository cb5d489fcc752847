"""Learning of a drag that the vehicle file only estimates.

Two factors f on the file's drag d, across the thrust and along it, follow from the acceleration that thrust and weight
do not explain, by recursive least squares:

    v' + g - T z_b / m = f d(v) / m0 + b

m is the estimated mass, m0 the file's. The disturbance b, such as wind, is unknown: only deviations from the means of
some seconds count. Both sides are divided by the drag at 1 m/s in hover, so that d becomes a velocity.
"""

from math import sqrt

import numpy as np

from colibri.autopilot.control.vehicle_model.airframe import Airframe
from colibri.common.jit import compiled
from colibri.common.matrices import dot
from colibri.common.types import Array, Vector

LEARNED = 18
"""Of each factor: f - 1; its information, (m/s)² s; seconds of the means; means of d and left side, m/s, (3,) each."""
_ACROSS, _ALONG = 0, 9
_LEAST_1_S = 0.01  # divisor with less drag
_MEAN_S = 5.0
_MOVING_M_S = 1.0  # least deviation of the velocity that counts: in hover, gusts cause the motion
_GUESSED, _MOST = 0.5, 500.0  # information in the file's number; in recent motion: more forgets the oldest
_JUMP = 3.0  # largest error of a factor in one sample: more is a jump of the measured velocity
_LEAST_FACTOR, _MOST_FACTOR = 0.4, 2.5


@compiled
def with_learned(airframe: Airframe, mass_kg: float, learned: Array) -> Airframe:
    across = mass_kg / airframe.mass_kg * (1.0 + learned[_ACROSS])
    along = mass_kg / airframe.mass_kg * (1.0 + learned[_ALONG])
    return Airframe(
        mass_kg, airframe.gravity_m_s2, across * airframe.drag_xy, along * airframe.drag_z, across * airframe.rotor_drag
    )


@compiled
def learn_drag(
    drag_n: Vector, unexplained_m_s2: Array, up: Array, airframe: Airframe, interval_s: float, learned: Array
) -> Vector:
    """Return the acceleration by drag, m/s², ENU, after learning from the one that thrust and weight do not explain."""
    hover_n_s_m = airframe.drag_xy + airframe.rotor_drag * sqrt(airframe.mass_kg * airframe.gravity_m_s2)
    x_1_s, z_1_s = max(hover_n_s_m / airframe.mass_kg, _LEAST_1_S), max(airframe.drag_z / airframe.mass_kg, _LEAST_1_S)
    drag, along, unexplained = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        drag[i] = drag_n[i] / airframe.mass_kg
    drag_up, unexplained_up = dot(drag, up), dot(unexplained_m_s2, up)
    for i in range(3):
        along[i], unexplained[i] = drag_up * up[i], unexplained_up * up[i]
    across_v, across_u, along_v, along_u = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        across_v[i], across_u[i] = (drag[i] - along[i]) / x_1_s, (unexplained_m_s2[i] - unexplained[i]) / x_1_s
        along_v[i], along_u[i] = along[i] / z_1_s, unexplained[i] / z_1_s
    x, z = learned[_ACROSS:_ALONG], learned[_ALONG:]
    x_squared, x_product = _deviate(across_v, across_u, interval_s, x)
    z_squared, z_product = _deviate(along_v, along_u, interval_s, z)
    if x_squared + z_squared > _MOVING_M_S * _MOVING_M_S:
        _fit(x_squared, x_product, interval_s, x)
        _fit(z_squared, z_product, interval_s, z)
    for i in range(3):
        drag[i] += x[0] * (drag[i] - along[i]) + z[0] * along[i]
    return drag[0], drag[1], drag[2]


@compiled
def _deviate(velocity: Array, unexplained: Array, interval_s: float, learned: Array) -> tuple[float, float]:
    """Update the means; return the squared deviation of the velocity, and the product of both deviations."""
    learned[2] = min(learned[2] + interval_s, _MEAN_S)
    squared, product = 0.0, 0.0
    for i in range(3):
        learned[3 + i] += interval_s / learned[2] * (velocity[i] - learned[3 + i])
        learned[6 + i] += interval_s / learned[2] * (unexplained[i] - learned[6 + i])
        deviation = velocity[i] - learned[3 + i]
        squared += deviation * deviation
        product += deviation * (unexplained[i] - learned[6 + i])
    return squared, product


@compiled
def _fit(squared: float, product: float, interval_s: float, learned: Array) -> None:
    learned[1] = min(learned[1] + interval_s * squared, _MOST)
    missed = min(max(product - (1.0 + learned[0]) * squared, -_JUMP * squared), _JUMP * squared)
    factor = 1.0 + learned[0] + interval_s * missed / (_GUESSED + learned[1])
    learned[0] = min(max(factor, _LEAST_FACTOR), _MOST_FACTOR) - 1.0
