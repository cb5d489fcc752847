"""Report of a companion's flight, with the keys of `colibri fly` where they mean the same."""

from math import degrees, isfinite
from typing import Any

from colibri.autopilot.control.interface import Fallback
from colibri.companion.guide import Companion
from colibri.companion.setpoints import FlightSummary

SETTLED_AFTER_S = 20.0


def report(companion: Companion, summary: FlightSummary, given: dict[str, Any]) -> dict[str, Any]:
    errors, peer, ended = companion.errors, companion.peer, companion.ended
    return {
        **given,
        "stack": peer.stack.name if peer.stack else None,
        "feedback": "the vehicle's estimate",
        "ended": "interrupted" if ended is None else ended.why,
        "in_order": ended is not None and ended.in_order,
        "lost": None if ended is None or ended.in_order else ended.why,
        "limit": companion.limit.name if companion.limit else None,
        "phases": summary.phases,
        "sim_time_s": errors.flown_s,
        "wall_time_s": summary.last_s - summary.first_s,
        "states_on_track": errors.samples,
        "rmse_m": _finite(errors.rmse_m()),
        "max_error_m": _finite(errors.max_m),
        "rmse_after_20s_m": _finite(errors.rmse_m(SETTLED_AFTER_S)),
        "control_rmse_m": _finite(errors.rmse_m()),
        "max_tilt_deg": degrees(summary.max_tilt_rad),
        "setpoints": summary.sent,
        "setpoint_rate_hz": _finite(summary.rate_hz),
        "fallbacks": {str(fallback): summary.fallbacks[fallback] for fallback in Fallback},
        "round_trip_ms": peer.clock.round_trip_us * 1e-3,
        "state_delay_ms": peer.state_delay_s * 1e3,
        "max_state_age_ms": summary.max_age_s * 1e3,
        "thrust_scale": companion.thrust_scale,
        "parameters": peer.parameter_values,
    }


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None
