"""The empty QP of a plan: planned variables, then slacks of soft limits."""

import numpy as np

from colibri.autopilot.control.qp import Qp

_MAX_SLACK = 100.0


def empty_qp(moved: int, slacks: int, rows: int, slack_weight: float) -> Qp:
    n = moved + slacks
    H, f = np.zeros((n, n)), np.zeros(n)
    H[moved:, moved:] = slack_weight * np.eye(slacks)
    f[moved:] = slack_weight
    return Qp(H, f, np.zeros((rows, n)), np.zeros(rows), np.zeros(n), np.full(n, _MAX_SLACK))
