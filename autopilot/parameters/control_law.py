"""Parameters of a control law that can change in flight."""

from collections.abc import Mapping
from typing import Any

from colibri.autopilot.parameters.number_paths import Number, Path, has, named

_TURN = ("1st", "2nd")
_MOMENTS = ("roll", "pitch", "yaw")

STRUCTURE = frozenset({"control_interval_s", "qp"})
"""Keys of any control law fixed in flight."""
_PREFIX_LENGTH = 3


def law_numbers(controller: str, table: Mapping[str, Any]) -> list[Number]:
    """Return a law's numbers; undescribed ones are named by their keys."""
    if controller in DESCRIBED:
        return [number for number in DESCRIBED[controller] if has(table, number.path)]
    letters = "".join(letter for letter in controller.upper() if letter.isascii() and letter.isalnum())
    start = letters.lstrip("0123456789") or "LAW"
    return named(start[:_PREFIX_LENGTH], table, STRUCTURE)


def _axes(
    names: str, key: Path, unit: str, minimum: float, maximum: float, what: str, decimals: int = 3
) -> list[Number]:
    return [
        Number(name, (*key, place), unit, minimum, maximum, what.format(_MOMENTS[place]), decimals=decimals)
        for place, name in enumerate(names.split())
    ]


def _poles(name: str, key: Path, what: str) -> list[Number]:
    return [
        Number(f"{name}{place + 1}", (*key, "poles", place), "rad/s", -20.0, -0.5, f"{turn} pole of {what}")
        for place, turn in enumerate(_TURN)
    ]


def _references(prefix: str) -> list[Number]:
    speed, tilt = ("guidance", "approach_speed_m_s"), ("guidance", "max_tilt_deg")
    return [
        Number(f"{prefix}_APPROACH", speed, "m/s", 0.1, 30.0, "Approach speed to a far reference"),
        Number(f"{prefix}_TILT_MAX", tilt, "deg", 5.0, 180.0, "Maximum tilt; from 90 on: none", decimals=1),
    ]


def _observed(prefix: str) -> list[Number]:
    acceleration, moment, mass = f"{prefix}_OBS_ACC", f"{prefix}_OBS_MOM", f"{prefix}_MASS"
    return [
        Number(acceleration, ("observer", "acceleration_rad_s"), "rad/s", 0.1, 60.0, "Force observer bandwidth"),
        Number(moment, ("observer", "moment_rad_s"), "rad/s", 0.1, 60.0, "Moment observer bandwidth"),
        Number(
            f"{acceleration}_MAX",
            ("observer", "max_acceleration_m_s2"),
            *("m/s^2", 0.01, 20.0, "Maximum disturbance"),
        ),
        Number(f"{moment}_MAX", ("observer", "max_moment_n_m"), "N m", 0.001, 10.0, "Maximum disturbance moment"),
        Number(f"{mass}_RATE", ("mass", "rate_1_s"), "1/s", 0.0, 2.0, "Mass adaptation rate; 0: off"),
        Number(f"{mass}_MIN", ("mass", "min_ratio"), "", 0.1, 1.0, "Minimum mass over VEH_MASS"),
        Number(f"{mass}_MAX", ("mass", "max_ratio"), "", 1.0, 10.0, "Maximum mass over VEH_MASS"),
    ]


def _limits(prefix: str, key: str) -> list[Number]:
    return [
        *_axes(
            f"{prefix}_RATE_P {prefix}_RATE_Q {prefix}_RATE_R",
            (key, "max_rate_rad_s"),
            *("rad/s", 0.5, 50.0, "Soft limit of {} rate"),
        ),
        Number(f"{prefix}_SLACK", (key, "slack_weight"), "", 1.0, 1e6, "Slack weight", decimals=1),
    ]


def _recovery(prefix: str) -> list[Number]:
    return [
        Number(f"{prefix}_FB_TURN", ("fallback", "turn_1_s"), "1/s", 0.1, 50.0, "Recovery: attitude gain"),
        Number(f"{prefix}_FB_RATE", ("fallback", "rate_1_s"), "1/s", 0.1, 100.0, "Recovery: rate gain"),
        Number(f"{prefix}_FB_FASTEST", ("fallback", "max_rate_rad_s"), "rad/s", 0.1, 50.0, "Recovery: maximum rate"),
        Number(f"{prefix}_QP_ITER", ("qp", "max_iterations"), "", 20, 100_000, "Maximum QP iterations"),
    ]


LPV_MPC = [
    *_poles("LPV_POLE", ("guidance",), "large position errors"),
    Number("LPV_EXACT", ("guidance", "exact_within_m"), "m", 0.01, 10.0, "Reference followed exactly within"),
    *_references("LPV"),
    Number("LPV_FOLLOW", ("guidance", "follow_within_m"), "m", 0.01, 10.0, "Reference followed fully within"),
    Number(
        "LPV_ACC_MAX", ("guidance", "max_acceleration_m_s2"), "m/s^2", 0.5, 50.0, "Maximum acceleration on large errors"
    ),
    Number("LPV_THR_MIN", ("guidance", "min_thrust"), "norm", 0.01, 0.9, "Minimum thrust-to-weight of references"),
    *_observed("LPV"),
    Number("LPV_ANGLE_MAX", ("plan", "max_tilt_deg"), "deg", 10.0, 180.0, "Soft limit of tilt; 180: none", decimals=1),
    *_limits("LPV", "plan"),
    Number("LPV_PATH_MIN", ("path", "min_speed"), "norm", 0.05, 1.0, "Minimum path speed; 1: on the clock"),
    Number("LPV_PATH_REWARD", ("path", "reward"), "1/s", 0.01, 1e4, "Path progress reward"),
    Number("LPV_PATH_CHANGE", ("path", "change"), "", 1e-3, 1e4, "Path speed change weight"),
    Number("LPV_Q_POSITION", ("weights", "position"), "1/m^2", 1e-2, 1e5, "Position weight"),
    Number("LPV_Q_VELOCITY", ("weights", "velocity"), "s^2/m^2", 1e-4, 1e4, "Velocity weight"),
    Number("LPV_Q_HEADING", ("weights", "heading"), "1/rad^2", 1e-4, 1e3, "Heading weight"),
    Number("LPV_Q_RATE", ("weights", "rate"), "s^2/rad^2", 1e-5, 1e2, "Rate weight", decimals=4),
    Number("LPV_Q_TILT", ("weights", "tilt"), "1/rad^2", 1e-3, 1e4, "Tilt weight, attitude setpoints"),
    Number("LPV_Q_THRUST", ("weights", "thrust"), "1/N^2", 1e-4, 1e3, "Thrust weight, attitude setpoints"),
    Number("LPV_R_FIRST", ("weights", "first_correction"), "", 1e-4, 1e2, "Weight on changes of the plan"),
    Number("LPV_R_NEXT", ("weights", "next_correction"), "", 1e-4, 1e2, "Weight on changes within the plan"),
    Number("LPV_TERM_THRUST", ("weights", "terminal_thrust"), "norm", 0.5, 3.0, "Terminal thrust-to-weight"),
    Number("LPV_FB_SHIFTED", ("fallback", "shifted_samples"), "", 1, 1000, "Fallback: samples of the previous plan"),
    *_poles("LPV_FB_POLE", ("fallback",), "the LQR fallback"),
    *_recovery("LPV"),
]
"""`colibri.autopilot.control.lpv_mpc.law`, without its samples, preview and solver."""
DESCRIBED = {"lpv-mpc": LPV_MPC}
"""Numbers by name of the control law."""
