"""The numbers of a control law that are parameters: those that can change in flight."""

from collections.abc import Mapping
from typing import Any

from colibri.autopilot.parameters.number_paths import Number, Path, has, named

_TURN = ("1st", "2nd")
_MOMENTS = ("roll", "pitch", "yaw")

STRUCTURE = frozenset({"control_interval_s", "qp"})
"""Keys of any control law whose numbers are not for changing in flight."""
_PREFIX_LENGTH = 3


def law_numbers(controller: str, table: Mapping[str, Any]) -> list[Number]:
    """Return the numbers in the table of a control law; where nobody described them, under names made of their keys."""
    if controller == "lpv-mpc":
        return [number for number in LPV_MPC if has(table, number.path)]
    letters = "".join(letter for letter in controller.upper() if letter.isascii() and letter.isalnum())
    start = letters.lstrip("0123456789") or "LAW"
    return named(start[:_PREFIX_LENGTH], table, STRUCTURE)


def _axes(
    names: str, key: Path, unit: str, minimum: float, maximum: float, what: str, decimals: int = 3
) -> list[Number]:
    """Return three numbers, of roll, pitch and yaw; described by `what`."""
    return [
        Number(name, (*key, place), unit, minimum, maximum, what.format(_MOMENTS[place]), decimals=decimals)
        for place, name in enumerate(names.split())
    ]


LPV_MPC = [
    *(
        Number(f"LPV_POLE{place + 1}", ("guidance", "poles", place), "rad/s", -20.0, -0.5, f"{turn} pole of position")
        for place, turn in enumerate(_TURN)
    ),
    Number("LPV_APPROACH", ("guidance", "approach_speed_m_s"), "m/s", 0.1, 30.0, "Speed towards a far reference"),
    Number("LPV_TILT_MAX", ("guidance", "max_tilt_deg"), "deg", 5.0, 80.0, "Largest tilt demanded", decimals=1),
    Number("LPV_THR_MARGIN", ("guidance", "thrust_margin"), "norm", 0.0, 0.45, "Thrust range kept for moments"),
    Number("LPV_OBS_ACC", ("observer", "acceleration_rad_s"), "rad/s", 0.1, 60.0, "Poles of the force observer"),
    Number("LPV_OBS_MOM", ("observer", "moment_rad_s"), "rad/s", 0.1, 60.0, "Poles of the moment observer"),
    Number(
        "LPV_OBS_ACC_MAX", ("observer", "max_acceleration_m_s2"), "m/s^2", 0.01, 20.0, "Largest disturbance assumed"
    ),
    Number("LPV_OBS_MOM_MAX", ("observer", "max_moment_n_m"), "N m", 0.001, 10.0, "Largest disturbance moment assumed"),
    Number("LPV_MASS_RATE", ("mass", "rate_1_s"), "1/s", 0.0, 2.0, "How fast the mass is learned; 0: never"),
    Number("LPV_MASS_MIN", ("mass", "min_ratio"), "", 0.1, 1.0, "Least mass assumed, to VEH_MASS"),
    Number("LPV_MASS_MAX", ("mass", "max_ratio"), "", 1.0, 10.0, "Largest mass assumed, to VEH_MASS"),
    *_axes("LPV_Q_PHI LPV_Q_THETA LPV_Q_PSI", ("attitude", "output_weight"), "", 1e-3, 1e3, "Weight on {} error"),
    *_axes("LPV_R_U2 LPV_R_U3 LPV_R_U4", ("attitude", "increment_weight"), "", 1e-3, 1e4, "Weight on {} changes"),
    *_axes(
        "LPV_DU2_MAX LPV_DU3_MAX LPV_DU4_MAX",
        ("attitude", "max_increment_n_m"),
        *("N m", 1e-3, 10.0, "Largest change of the {} moment"),
        decimals=4,
    ),
    Number("LPV_ANGLE_MAX", ("attitude", "max_angle_deg"), "deg", 10.0, 85.0, "Soft limit of roll, pitch", 1.0, 1),
    *_axes(
        "LPV_RATE_P LPV_RATE_Q LPV_RATE_R",
        ("attitude", "max_rate_rad_s"),
        *("rad/s", 0.5, 50.0, "Soft limit of the {} rate"),
    ),
    Number("LPV_SLACK", ("attitude", "slack_weight"), "", 1.0, 1e6, "Weight on exceeded soft limits", decimals=1),
    Number("LPV_FB_SHIFTED", ("fallback", "shifted_samples"), "", 1, 1000, "Without a plan: samples of the last"),
    Number("LPV_FB_LQR", ("fallback", "lqr_samples"), "", 1, 1000, "Without a plan: then, samples of an LQR"),
    Number(
        "LPV_FB_DESCENT", ("fallback", "descent_thrust"), "norm", 0.5, 0.99, "Without a plan: then, thrust of weight"
    ),
    Number("LPV_FB_TURN", ("fallback", "turn_1_s"), "1/s", 0.1, 50.0, "Recovery: turn for each rad left"),
    Number("LPV_FB_RATE", ("fallback", "rate_1_s"), "1/s", 0.1, 100.0, "Recovery: how fast the turn is reached"),
    Number("LPV_FB_FASTEST", ("fallback", "max_rate_rad_s"), "rad/s", 0.1, 50.0, "Recovery: fastest turn"),
    Number("LPV_QP_ITER", ("qp", "max_iterations"), "", 20, 100_000, "Iterations of the QP's solver at most"),
]
"""Of `colibri.autopilot.control.lpv_mpc.law`: all but its samples and the solver."""
