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
    drag = np.array(drag_n) / airframe.mass_kg
    along, unexplained = dot(drag, up) * up, dot(unexplained_m_s2, up) * up
    hover_n_s_m = airframe.drag_xy + airframe.rotor_drag * sqrt(airframe.mass_kg * airframe.gravity_m_s2)
    x_1_s, z_1_s = max(hover_n_s_m / airframe.mass_kg, _LEAST_1_S), max(airframe.drag_z / airframe.mass_kg, _LEAST_1_S)
    x, z = learned[_ACROSS:_ALONG], learned[_ALONG:]
    x_squared, x_product = _deviate((drag - along) / x_1_s, (unexplained_m_s2 - unexplained) / x_1_s, interval_s, x)
    z_squared, z_product = _deviate(along / z_1_s, unexplained / z_1_s, interval_s, z)
    if x_squared + z_squared > _MOVING_M_S * _MOVING_M_S:
        _fit(x_squared, x_product, interval_s, x)
        _fit(z_squared, z_product, interval_s, z)
    drag += x[0] * (drag - along) + z[0] * along
    return drag[0], drag[1], drag[2]


@compiled
def _deviate(velocity: Array, unexplained: Array, interval_s: float, learned: Array) -> tuple[float, float]:
    """Update the means; return the squared deviation of the velocity, and the product of both deviations."""
    learned[2] = min(learned[2] + interval_s, _MEAN_S)
    learned[3:6] += interval_s / learned[2] * (velocity - learned[3:6])
    learned[6:9] += interval_s / learned[2] * (unexplained - learned[6:9])
    deviation = velocity - learned[3:6]
    return dot(deviation, deviation), dot(deviation, unexplained - learned[6:9])


@compiled
def _fit(squared: float, product: float, interval_s: float, learned: Array) -> None:
    learned[1] = min(learned[1] + interval_s * squared, _MOST)
    missed = min(max(product - (1.0 + learned[0]) * squared, -_JUMP * squared), _JUMP * squared)
    factor = 1.0 + learned[0] + interval_s * missed / (_GUESSED + learned[1])
    learned[0] = min(max(factor, _LEAST_FACTOR), _MOST_FACTOR) - 1.0
