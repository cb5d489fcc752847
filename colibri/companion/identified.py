"""Result of an identification, as a file for later flights."""

from typing import NamedTuple

import numpy as np

from colibri.companion.guide import Companion
from colibri.companion.identification.fit import Fit, RateLog, fit
from colibri.companion.response_file import response_text
from colibri.companion.stacks.stack import Response


class Identified(NamedTuple):
    """A response, the text of its file, and its fit."""

    response: Response
    text: str
    fit: Fit


def identified(companion: Companion) -> Identified:
    """Fit the response to a companion's steps."""
    stack, steps = companion.peer.stack, companion.steps
    assert stack is not None, "it has flown"
    assert steps is not None, "it was an identification"
    commanded, measured = (np.reshape(rows, (-1, 4)) for rows in (steps.commanded, steps.measured))
    found = fit(RateLog(commanded[:, 0], commanded[:, 1:], measured[:, 0], measured[:, 1:]))
    p, q, r = found.time_constant_s.tolist()
    response = stack.response._replace(time_constant_s=(p, q, r), latency_s=found.latency_s)
    if found.order > 1:
        response = _of_second_order(response, found)
    explained = ", ".join(f"{100.0 * part:.0f}" for part in found.explained)
    remarks = [
        f"Identified in flight on {stack.name}: a lag of order {found.order} of the body rates p, q, r.",
        f"It explains {explained} % of their variance. For colibri companion --response.",
    ]
    return Identified(response, response_text(response, companion.thrust_scale, remarks), found)


def _of_second_order(response: Response, found: Fit) -> Response:
    """Add the lags of the accelerations, and raise their limits to the rate loop's largest demand.

    A law built for less would brake late after a disturbance, and swing.
    """
    p, q, r = found.acceleration_lag_s.tolist()
    most_p, most_q, most_r = (
        max(assumed, rate / lag_s) if behind_s > 0.0 else assumed
        for assumed, rate, lag_s, behind_s in zip(
            response.max_acceleration_rad_s2,
            response.max_rate_rad_s,
            response.time_constant_s,
            (p, q, r),
            strict=True,
        )
    )
    return response._replace(acceleration_lag_s=(p, q, r), max_acceleration_rad_s2=(most_p, most_q, most_r))
