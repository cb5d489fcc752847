"""What an identification has found, as the file that later flights read."""

from typing import NamedTuple

import numpy as np

from colibri.companion.guide import Companion
from colibri.companion.identification.fit import Fit, RateLog, fit
from colibri.companion.response_file import response_text
from colibri.companion.stacks.stack import Response


class Identified(NamedTuple):
    """A response, the text of its file, and the fit that it comes from."""

    response: Response
    text: str
    fit: Fit


def identified(companion: Companion) -> Identified:
    """Return the response of the steps that a companion has flown.

    Raises:
        CompanionError: They do not tell it.
    """
    stack = companion.peer.stack
    assert stack is not None, "it has flown"
    commanded, measured = (np.reshape(rows, (-1, 4)) for rows in (companion.commanded, companion.measured))
    found = fit(RateLog(commanded[:, 0], commanded[:, 1:], measured[:, 0], measured[:, 1:]))
    p, q, r = found.time_constant_s.tolist()
    response = stack.response._replace(time_constant_s=(p, q, r), latency_s=found.latency_s)
    explained = ", ".join(f"{100.0 * part:.0f}" for part in found.explained)
    remarks = [
        f"Identified in flight on {stack.name}: a first-order lag of the body rates p, q, r.",
        f"It explains {explained} % of their variance. For colibri companion --response.",
    ]
    return Identified(response, response_text(response, companion.thrust_scale, remarks), found)
