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
    return [
        Number(
            f"{prefix}_APPROACH", ("guidance", "approach_speed_m_s"), "m/s", 0.1, 30.0, "Speed towards a far reference"
        ),
        Number(
            f"{prefix}_TILT_MAX", ("guidance", "max_tilt_deg"), "deg", 5.0, 80.0, "Largest tilt demanded", decimals=1
        ),
    ]


def _observed(prefix: str) -> list[Number]:
    acceleration, moment, mass = f"{prefix}_OBS_ACC", f"{prefix}_OBS_MOM", f"{prefix}_MASS"
    return [
        Number(acceleration, ("observer", "acceleration_rad_s"), "rad/s", 0.1, 60.0, "Poles of the force observer"),
        Number(moment, ("observer", "moment_rad_s"), "rad/s", 0.1, 60.0, "Poles of the moment observer"),
        Number(
            f"{acceleration}_MAX",
            ("observer", "max_acceleration_m_s2"),
            *("m/s^2", 0.01, 20.0, "Largest disturbance assumed"),
        ),
        Number(
            f"{moment}_MAX", ("observer", "max_moment_n_m"), "N m", 0.001, 10.0, "Largest disturbance moment assumed"
        ),
        Number(f"{mass}_RATE", ("mass", "rate_1_s"), "1/s", 0.0, 2.0, "How fast the mass is learned; 0: never"),
        Number(f"{mass}_MIN", ("mass", "min_ratio"), "", 0.1, 1.0, "Least mass assumed, to VEH_MASS"),
        Number(f"{mass}_MAX", ("mass", "max_ratio"), "", 1.0, 10.0, "Largest mass assumed, to VEH_MASS"),
    ]


def _limits(prefix: str, key: str) -> list[Number]:
    return [
        *_axes(
            f"{prefix}_RATE_P {prefix}_RATE_Q {prefix}_RATE_R",
            (key, "max_rate_rad_s"),
            *("rad/s", 0.5, 50.0, "Soft limit of the {} rate"),
        ),
        Number(f"{prefix}_SLACK", (key, "slack_weight"), "", 1.0, 1e6, "Weight on exceeded soft limits", decimals=1),
    ]


def _recovery(prefix: str) -> list[Number]:
    return [
        Number(f"{prefix}_FB_TURN", ("fallback", "turn_1_s"), "1/s", 0.1, 50.0, "Recovery: turn for each rad left"),
        Number(
            f"{prefix}_FB_RATE", ("fallback", "rate_1_s"), "1/s", 0.1, 100.0, "Recovery: how fast the turn is reached"
        ),
        Number(f"{prefix}_FB_FASTEST", ("fallback", "max_rate_rad_s"), "rad/s", 0.1, 50.0, "Recovery: fastest turn"),
        Number(f"{prefix}_QP_ITER", ("qp", "max_iterations"), "", 20, 100_000, "Iterations of the QP's solver at most"),
    ]


LPV_MPC = [
    *_poles("LPV_POLE", ("guidance",), "a large position error"),
    Number("LPV_EXACT", ("guidance", "exact_within_m"), "m", 0.01, 10.0, "Nearer references are taken as they are"),
    *_references("LPV"),
    Number("LPV_FOLLOW", ("guidance", "follow_within_m"), "m", 0.01, 10.0, "Farther references count in part"),
    Number(
        "LPV_ACC_MAX", ("guidance", "max_acceleration_m_s2"), "m/s^2", 0.5, 50.0, "Acceleration of large errors' end"
    ),
    Number("LPV_THR_MIN", ("guidance", "min_thrust"), "norm", 0.01, 0.9, "Least thrust of references, of weight"),
    *_observed("LPV"),
    Number("LPV_ANGLE_MAX", ("plan", "max_tilt_deg"), "deg", 10.0, 85.0, "Soft limit of the tilt", decimals=1),
    *_limits("LPV", "plan"),
    Number("LPV_PATH_MIN", ("path", "min_speed"), "norm", 0.05, 1.0, "Least speed along the path; 1: on the clock"),
    Number("LPV_PATH_REWARD", ("path", "reward"), "1/s", 0.01, 1e4, "Reward on path time: more is closer to it"),
    Number("LPV_PATH_CHANGE", ("path", "change"), "", 1e-3, 1e4, "Weight on changes of the speed along it"),
    Number("LPV_Q_POSITION", ("weights", "position"), "1/m^2", 1e-2, 1e5, "Weight on position error"),
    Number("LPV_Q_VELOCITY", ("weights", "velocity"), "s^2/m^2", 1e-4, 1e4, "Weight on velocity error"),
    Number("LPV_Q_HEADING", ("weights", "heading"), "1/rad^2", 1e-4, 1e3, "Weight on heading error"),
    Number("LPV_Q_RATE", ("weights", "rate"), "s^2/rad^2", 1e-5, 1e2, "Weight on errors of the rates", decimals=4),
    Number("LPV_Q_TILT", ("weights", "tilt"), "1/rad^2", 1e-3, 1e4, "Weight on tilt error, of demanded attitudes"),
    Number("LPV_Q_THRUST", ("weights", "thrust"), "1/N^2", 1e-4, 1e3, "Weight on thrust error, of demanded ones"),
    Number("LPV_R_FIRST", ("weights", "first_correction"), "", 1e-4, 1e2, "Weight on changes from the last plan"),
    Number("LPV_R_NEXT", ("weights", "next_correction"), "", 1e-4, 1e2, "Weight on changes within a plan"),
    Number("LPV_TERM_THRUST", ("weights", "terminal_thrust"), "norm", 0.5, 3.0, "Thrust of weight, after the plan"),
    Number("LPV_FB_SHIFTED", ("fallback", "shifted_samples"), "", 1, 1000, "Without a plan: samples of the last"),
    *_poles("LPV_FB_POLE", ("fallback",), "position, of recovery"),
    *_recovery("LPV"),
]
"""`colibri.autopilot.control.lpv_mpc.law`, without its samples, preview and solver."""
DESCRIBED = {"lpv-mpc": LPV_MPC}
"""Numbers by name of the control law."""
