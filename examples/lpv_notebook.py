"""Cells of a notebook (VS Code, Jupytext): the LPV model of attitude at two scheduling points.

The notebook docs/notebooks/lpv-model.ipynb derives the model and its QP.

Prints:
    states: 6
    rows of A that change with the rates: phi_rate, theta_rate
    sampled at 0.1 s: (6, 3)
"""

# %% The model at rest, and while the vehicle turns
import numpy as np

from colibri import lpv

rest = lpv.model("hummingbird-thesis")
turning = lpv.model("hummingbird-thesis", lpv.Point(phi_rate_rad_s=2.0, theta_rate_rad_s=2.0))
print("states:", len(lpv.STATES))

# %% How the scheduling point moves its entries
changed = np.flatnonzero((rest.A != turning.A).any(axis=1))
print("rows of A that change with the rates:", ", ".join(lpv.STATES[row] for row in changed))

# %% The sampled model
print("sampled at 0.1 s:", rest.sampled(0.1).B.shape)
