"""A control law that keeps every promise, and laws that each break one."""

from collections.abc import Mapping
from itertools import count
from typing import Any

import numpy as np

import colibri

_COUNT = count()


class Good:
    """Tilts towards the reference, climbs towards its height; it remembers how far it was off, and does no more."""

    control_interval_us = 10_000
    preview = colibri.Preview(interval_us=10_000, samples=1)

    def __init__(self, table: Mapping[str, Any], vehicle: colibri.Vehicle, _clock: object) -> None:
        self.mixer, self.table = colibri.Mixer(vehicle), table
        self.mass, self.gravity = vehicle.body.mass_kg, vehicle.gravity_m_s2
        self.inertia = np.array(vehicle.body.inertia_kg_m2)
        self.offset = np.zeros(3)

    def initial(self, _rotor_speed: float) -> Any:
        return 0.0

    def step(self, _memory: Any, _time_us: int, state: colibri.VehicleState, references: Any) -> tuple[Any, Any]:
        error = references.position_enu_m[0] - state.position_enu_m + self.offset
        ax, ay, az = 2.0 * error + 2.5 * (references.velocity_enu_m_s[0] - state.velocity_enu_m_s)
        yaw = state.euler[2]
        pitch = np.clip((ax * np.cos(yaw) + ay * np.sin(yaw)) / self.gravity, -0.5, 0.5)
        roll = np.clip((ax * np.sin(yaw) - ay * np.cos(yaw)) / self.gravity, -0.5, 0.5)
        wanted = np.array([roll, pitch, references.yaw_rad[0]])
        moment = self.inertia * (100.0 * (wanted - state.euler) - 18.0 * np.array(state.rate_flu_rad_s))
        speeds = self.mixer.rotor_speeds(np.array([self.mass * (self.gravity + az), *moment]))
        return float(np.linalg.norm(error)), self.given(colibri.Decision(speeds, tuple(wanted)))

    def given(self, decision: Any) -> Any:
        return decision


class Stateful(Good):
    asked = 0

    def given(self, decision: Any) -> Any:
        self.asked += 1
        return decision._replace(rotor_speeds=decision.rotor_speeds * (1.0 - 1e-6 * (self.asked % 7)))


class Remembering(Good):
    def initial(self, _rotor_speed: float) -> list[int]:
        return [0]

    def step(self, memory: Any, *args: Any) -> tuple[Any, Any]:
        memory[0] += 1
        _, decision = super().step(memory, *args)
        return memory, decision._replace(rotor_speeds=decision.rotor_speeds * (1.0 - 1e-6 * memory[0]))


class Unpicklable(Good):
    def step(self, *args: Any) -> tuple[Any, Any]:
        memory, decision = super().step(*args)
        return (lambda: memory), decision


class Random(Good):
    def given(self, decision: Any) -> Any:
        return decision._replace(rotor_speeds=decision.rotor_speeds * (1.0 - 1e-9 * next(_COUNT)))


class BuiltOtherwise(Good):
    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.offset = np.array([1e-6 * next(_COUNT), 0.0, 0.0])


class Overwriting(Good):
    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.speeds = np.zeros(4)

    def given(self, decision: Any) -> Any:
        self.speeds[:] = decision.rotor_speeds
        return decision._replace(rotor_speeds=self.speeds)


class Scribbling(Good):
    def step(self, memory: Any, time_us: int, state: Any, references: Any) -> tuple[Any, Any]:
        references.position_enu_m[0, 0] += 1e-3
        return super().step(memory, time_us, state, references)


class NoUpsideDown(Good):
    def step(self, memory: Any, time_us: int, state: Any, references: Any) -> tuple[Any, Any]:
        if abs(state.euler[0]) > 2.0:
            raise ValueError("no model for this roll")
        return super().step(memory, time_us, state, references)


class NotFinite(Good):
    def step(self, memory: Any, time_us: int, state: Any, references: Any) -> tuple[Any, Any]:
        memory, decision = super().step(memory, time_us, state, references)
        part = 1.0 if state.position_enu_m[2] > 1e-3 else np.nan
        return memory, decision._replace(rotor_speeds=part * decision.rotor_speeds)


class TooFast(Good):
    def step(self, memory: Any, time_us: int, state: Any, references: Any) -> tuple[Any, Any]:
        memory, decision = super().step(memory, time_us, state, references)
        off_m = np.linalg.norm(references.position_enu_m[0] - state.position_enu_m)
        return memory, decision._replace(rotor_speeds=decision.rotor_speeds * (3.0 if off_m > 5.0 else 1.0))


class Listed(Good):
    def given(self, decision: Any) -> Any:
        return decision._replace(rotor_speeds=decision.rotor_speeds.tolist())


class NoAngles(Good):
    def given(self, decision: Any) -> Any:
        return decision._replace(attitude_reference=None)


class NoDiagnostics(Good):
    def given(self, decision: Any) -> Any:
        return decision._replace(diagnostics=None)


class Drifting(Good):
    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.offset = np.array([0.8, 0.0, 0.0])


class Half(Good):
    def charge_ah(self, _memory: Any) -> float:
        return 0.0


class Forgetful(Half):
    def with_charge(self, memory: Any, _charge_ah: float) -> Any:
        return memory


class Tilted(Good):
    def step_attitude(self, memory: Any, _time_us: int, state: Any, demand: Any) -> tuple[Any, Any]:
        wanted = demand.angles[0] * (-1.0, 1.0, 1.0)
        moment = self.inertia * (100.0 * (wanted - state.euler) - 18.0 * np.array(state.rate_flu_rad_s))
        speeds = self.mixer.rotor_speeds(np.array([max(demand.thrust_n[0], 0.0), *moment]))
        return memory, colibri.Decision(speeds, tuple(wanted))


class LateLoading(Good):
    def warm_up(self) -> None:
        self.offset = np.array([1e-6, 0.0, 0.0])


class TableBound(Good):
    def initial(self, _rotor_speed: float) -> float:
        return float(self.table["gain"])

    def step(self, memory: float, *args: Any) -> tuple[float, Any]:
        if memory != self.table["gain"]:
            raise KeyError("another gain")
        return memory, super().step(memory, *args)[1]


class LostAnew(Good):
    def initial(self, _rotor_speed: float) -> int:
        return 0

    def step(self, memory: int, time_us: int, *args: Any) -> tuple[int, Any]:
        if memory == 0 and time_us > 0:
            raise RuntimeError("not begun")
        return 1, super().step(memory, time_us, *args)[1]


class OfTwoTypes(Good):
    def initial(self, _rotor_speed: float) -> None:
        return None

    def step(self, memory: Any, *args: Any) -> tuple[Any, Any]:
        asked = memory[0] + 1 if memory else 0
        decision = super().step(memory, *args)[1]
        return (asked,), decision._replace(rotor_speeds=decision.rotor_speeds * (1.0 - 1e-6 * asked))
