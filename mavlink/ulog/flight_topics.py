"""Colibri's own topics of a flight, in SI, ENU and FLU: the file's format, CSV and docs/files.md derive from them."""

from dataclasses import dataclass
from functools import cached_property
from itertools import chain, groupby
from math import nan
from struct import Struct

import numpy as np
from numpy.typing import NDArray

from colibri.common.types import Array, PerRotor
from colibri.mavlink.ulog.topics import head, message_layout

_US_PER_S = 1e6


@dataclass(frozen=True, slots=True)
class Columns:
    """Columns of one meaning; `names` separated by spaces."""

    names: str
    unit: str
    help: str
    kind: str = "double"  # in the file; smaller than double only if lossless


@dataclass(frozen=True, eq=False)
class Topic:
    """A topic as a table: one row per instant, `t` (s) first."""

    name: str
    number: int  # in the file, for all processes that write to it
    table: str  # name of the CSV table
    rows: str  # meaning of a row
    columns: tuple[Columns, ...]  # all except the time
    block_rows: int = 128  # rows written at once

    @cached_property
    def names(self) -> tuple[str, ...]:
        return ("t", *chain.from_iterable(each.names.split() for each in self.columns))

    @cached_property
    def fields(self) -> str:
        fields = (f"{each.kind} {name};" for each in self.columns for name in each.names.split())
        return "uint64_t timestamp;" + "".join(fields)

    @cached_property
    def layout(self) -> np.dtype[np.void]:
        return message_layout(self.fields)

    @cached_property
    def pack(self) -> Struct:
        """Return the layout of a row as doubles."""
        return Struct(f"<{len(self.names)}d")

    def encode(self, table: Array) -> bytes:
        """Encode rows, (n, columns), time in µs; numbers beyond the range of a column become infinite, or wrap."""
        encoded = np.zeros(len(table), self.layout)
        encoded["size"], encoded["kind"], encoded["number"] = head(self.layout, self.number)
        encoded["timestamp"] = table[:, :1]
        for name, place in self._runs:
            encoded[name] = table[:, place]
        return encoded.tobytes()

    def decode(self, encoded: NDArray[np.void]) -> Array:
        rows = np.empty((len(encoded), len(self.names)))
        rows[:, :1] = encoded["timestamp"] / _US_PER_S
        for name, place in self._runs:
            rows[:, place] = encoded[name]
        return rows

    @cached_property
    def _runs(self) -> list[tuple[str, slice]]:
        kinds = [(each.kind, name) for each in self.columns for name in each.names.split()]
        runs, begin = [], 1
        for _, run in groupby(kinds, key=lambda each: each[0]):
            names = [name for _, name in run]
            runs.append((names[0], slice(begin, begin + len(names))))
            begin += len(names)
        return runs


_RATES = Columns("p q r", "rad/s", "body rates, FLU")
_ATTITUDE = Columns("qw qx qy qz", "", "attitude quaternion wxyz, FLU to ENU")
_POSITION = Columns("x y z", "m", "position, ENU")
_VELOCITY = Columns("vx vy vz", "m/s", "velocity, ENU")

TRUTH = Topic(
    *("colibri_truth", 101, "plant.csv", "a frame: the truth"),
    columns=(
        *(Columns("u v w", "m/s", "velocity, FLU"), _RATES, _POSITION, _ATTITUDE),
        Columns("omega1 omega2 omega3 omega4", "the vehicle's", "rotor speed"),
        Columns("voltage_v", "V", "battery voltage under load, or `nan`"),
        Columns("charge_ah", "Ah", "charge drawn from the battery"),
        Columns("wind_east wind_north wind_up", "m/s", "wind at the vehicle, with turbulence and gusts"),
    ),
)
DECISION = Topic(
    *("colibri_decision", 102, "autopilot.csv", "a control sample: the decision"),
    columns=(
        Columns("phi_ref theta_ref psi_ref", "rad", "attitude setpoint"),
        Columns("qp_status", "", "how the QP ended", "int8_t"),
        Columns("fallback", "", "fallback used instead", "int8_t"),
        Columns("solve_time_us", "µs", "solve time of the QP, wall clock", "float"),
        Columns("control_step_us", "µs", "time from frame to command, wall clock", "float"),
        Columns("cost", "", "cost of the plan"),
        Columns("slack", "parts", "largest planned excess of a soft limit, relative"),
        Columns(
            "active_rotors active_increments active_angles active_rates", "", "active constraints by kind", "uint16_t"
        ),
        Columns("delay_us", "µs", "compensated delay from frame to effect of its command", "float"),
        Columns("mass_kg", "kg", "mass estimated by the control law, or `nan`"),
        Columns("path_lag_s", "s", "lag of the path time behind the clock, or `nan`"),
        Columns("qp_iterations", "", "iterations of the QP solver, or `nan`", "float"),
    ),
)
MEASURED = ("velocity", "position", "height", "pressure", "field", "distance")  # in the order of `FILTER`
ESTIMATE = Topic(
    *("colibri_estimate", 103, "estimate.csv", "a control sample on sensors: the estimate"),
    columns=(
        *(_POSITION, _VELOCITY, _ATTITUDE, _RATES),
        Columns("sd_x sd_y sd_z", "m", "standard deviation of the position"),
        Columns("sd_vx sd_vy sd_vz", "m/s", "standard deviation of the velocity"),
        Columns("sd_east sd_north sd_up", "rad", "standard deviation of the attitude, about the axes of ENU"),
        Columns("gyro_bias_x gyro_bias_y gyro_bias_z", "rad/s", "estimated gyroscope bias, FLU"),
        Columns("accel_bias_x accel_bias_y accel_bias_z", "m/s²", "estimated accelerometer bias, FLU"),
        Columns("flags", "", "bits of ESTIMATOR_STATUS_FLAGS", "uint32_t"),
        Columns("rejected", "", "rejected measurements so far", "uint32_t"),
        Columns("resets", "", "resets of parts of the state so far", "uint32_t"),
    ),
)
FILTER = Topic(
    *("colibri_filter", 104, "filter.csv", "a tenth of a second on sensors: state and covariance of the filter"),
    columns=(
        *(_POSITION, _VELOCITY, _ATTITUDE),
        Columns(
            " ".join(f"P{row}{column}" for row in range(9) for column in range(row, 9)),
            "",
            "error covariance of position, velocity and attitude: upper triangle, row by row",
        ),
        Columns(
            " ".join(f"nis_{kind}" for kind in MEASURED),
            "",
            "sum of normalised innovations squared since the start, by measurement",
        ),
        Columns(" ".join(f"believed_{kind}" for kind in MEASURED), "", "accepted measurements since the start"),
    ),
)
COMMAND = Topic(
    *("colibri_command", 105, "command.csv", "a frame that was answered: the command"),
    columns=(
        Columns("control1 control2 control3 control4", "", "rotor speeds relative to the largest", "float"),
        Columns("armed", "", "1 if armed", "uint8_t"),
    ),
)
ROTORS = 4  # in `TRUTH` and `COMMAND`
MORE_TRUTH = Topic(
    *("colibri_more_truth", 107, "more_rotors.csv", "a frame: rotors beyond the fourth, `nan` if missing"),
    columns=(Columns("omega5 omega6 omega7 omega8", "the vehicle's", "rotor speed"),),
)
MORE_COMMAND = Topic(
    *("colibri_more_command", 108, "more_commands.csv", "a command: rotors beyond the fourth, `nan` if missing"),
    columns=(Columns("control5 control6 control7 control8", "", "rotor speeds relative to the largest", "float"),),
)
FLIGHT_TOPICS = (TRUTH, DECISION, ESTIMATE, FILTER, COMMAND, MORE_TRUTH, MORE_COMMAND)


def split(rotors: PerRotor) -> tuple[PerRotor, PerRotor]:
    """Return four rotors, and the others or (), each filled up with nan."""
    if len(rotors) == ROTORS:
        return rotors, ()
    first, others = rotors[:ROTORS], rotors[ROTORS:]
    return _filled(first), _filled(others) if others else others


def _filled(rotors: PerRotor) -> PerRotor:
    return rotors if len(rotors) == ROTORS else (*rotors, *(nan,) * (ROTORS - len(rotors)))
