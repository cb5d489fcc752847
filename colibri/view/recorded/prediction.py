"""Compute the horizons of a recorded flight by replay."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.ground.forecast import Forecaster
from colibri.common.types import Array
from colibri.flights.provenance import plan_of
from colibri.flights.replay import answers_of

EVERY = 5  # control samples per horizon: 25 a second at 125 Hz


def predicted(folder: Path) -> Iterator[tuple[float, Array]]:
    """Yield time and points of each horizon, (k, 3), from the estimate on."""
    plan = plan_of(folder)
    loop = ControlLoop(plan.profile, plan.vehicle, lambda: 0.0, plan.spec.law)
    forecaster = Forecaster(plan.vehicle, loop.control_interval_us / 1e6, loop.plan_columns)
    decisions = 0
    for answer in answers_of(folder):
        if answer.step.decision is None or answer.known is None:
            continue
        decisions += 1
        if decisions % EVERY == 1:
            points = forecaster.forecast(loop.observe(answer.known), None, answer.step.decision.diagnostics)
            if points:
                here = answer.known.position_enu_m
                yield answer.time_us / 1e6, np.array([here, *(point.position_enu_m for point in points)])
