"""Learned policies as control laws: a class with `act`, or an ONNX file with a TOML file of its inputs and outputs."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.control.interface import Clock, Decision, Horizon, Preview, VehicleState
from colibri.autopilot.control.parts.policy_interface import aim, level_action, observe, scale_of, take, turn, width
from colibri.autopilot.errors import AutopilotError
from colibri.common.config import Table, read_toml
from colibri.common.errors import shown
from colibri.common.files import read_bytes
from colibri.common.kernels import cos, sin
from colibri.common.matrices import matmul, matvec
from colibri.common.rotations import earth_from_body, rotation_matrix
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_RATE_LOOP_MS = 5  # longest interval of the loop that holds body rates
_Rate = Annotated[float, msgspec.Meta(ge=0.1, le=50.0)]


class PolicyError(AutopilotError):
    """A policy, or the file of its inputs and outputs, is unusable."""


class PolicyInputs(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Observations and actions of a policy: keywords of the environment in which it has learned (docs/gym.md)."""

    action: Literal["rotors", "rates"]
    interval_ms: Annotated[int, msgspec.Meta(ge=1, le=100)]
    preview: Annotated[int, msgspec.Meta(ge=0, le=100)] = 0
    preview_ms: Annotated[int, msgspec.Meta(ge=1, le=10_000)] = 100
    history: Annotated[int, msgspec.Meta(ge=1, le=100)] = 1
    max_rates_rad_s: tuple[_Rate, _Rate, _Rate] = (8.0, 8.0, 4.0)


class PolicyMemory(NamedTuple):
    """Time of the last action, -1 before the first; yaw at the first; the last, and those before it, (h, a)."""

    time_us: int
    heading_rad: float
    last: Array
    older: Array


class PolicyLaw(ABC):
    """A control law by a policy; subclasses define `inputs` and `act`."""

    inputs: ClassVar[PolicyInputs]
    reads_motion = False

    def __init__(self, settings: Mapping[str, Any], vehicle: Vehicle, clock: Clock) -> None:
        del settings, clock
        inputs = self._inputs
        self._vehicle, self._rates = vehicle, inputs.action == "rates"
        self._rotors = vehicle.rotors.count
        self._actions = 4 if self._rates else self._rotors
        self._scale, self._mixer = scale_of(vehicle, inputs.max_rates_rad_s)
        ms = inputs.interval_ms
        if self._rates:  # a whole part of the action's interval
            ms = max(part for part in range(1, _RATE_LOOP_MS + 1) if ms % part == 0)
        self.control_interval_us = 1000 * ms
        self.preview = Preview(1000 * (inputs.preview_ms if inputs.preview else ms), 1 + inputs.preview)
        self._seen = np.zeros(width(self._actions, inputs.preview, inputs.history), dtype=np.float32)

    @property
    def _inputs(self) -> PolicyInputs:
        return self.inputs

    @abstractmethod
    def act(self, observation: NDArray[np.float32]) -> Any:
        """Return the action, -1 to 1, for an observation, both as in docs/gym.md."""

    def initial(self, rotor_speed: float) -> PolicyMemory:
        last = level_action((rotor_speed,) * self._rotors, self._vehicle, rates=self._rates)
        return PolicyMemory(-1, 0.0, last, np.tile(last, (self._inputs.history - 1, 1)))

    def step(
        self, memory: PolicyMemory, time_us: int, state: VehicleState, references: Horizon
    ) -> tuple[PolicyMemory, Decision]:
        w, i, j, k = state.attitude
        velocity = earth_from_body((w, -i, -j, -k), state.velocity_enu_m_s)
        x = np.array((*velocity, *state.rate_flu_rad_s, *state.position_enu_m, *state.attitude))
        if memory.time_us < 0 or time_us - memory.time_us >= 1000 * self._inputs.interval_ms:
            heading_rad = state.euler[2] if memory.time_us < 0 else memory.heading_rad
            memory = self._chosen(memory._replace(time_us=time_us, heading_rad=heading_rad), x, references)
        speeds = np.empty(self._rotors)
        if self._rates:
            aim(x, memory.last, self._mixer, self._scale, speeds)
        else:
            turn(memory.last, self._scale, speeds)
        return memory, Decision(speeds, state.euler)

    def _chosen(self, memory: PolicyMemory, x: Array, references: Horizon) -> PolicyMemory:
        last, older, seen = memory.last.copy(), memory.older.copy(), self._seen.copy()
        c, s = cos(0.5 * memory.heading_rad), -sin(0.5 * memory.heading_rad)  # it has learned to head east
        east = np.array(rotation_matrix((c, 0.0, 0.0, s)))
        w, i, j, k = x[9:]
        x[6:9] = matvec(east, x[6:9])
        x[9:] = c * w - s * k, c * i - s * j, c * j + s * i, c * k + s * w
        observe(x, last, older, matmul(references.position_enu_m, east.T), 0, 1, seen)
        given = self.act(seen)
        action = np.asarray(given, dtype=np.float64)
        if action.shape != last.shape or take(action, last, older) < 0.0:
            raise PolicyError(f'an action must be {self._actions} finite numbers, not "{shown(given)}"')
        return memory._replace(last=last, older=older)


class OnnxFile(NamedTuple):
    """The contents of a policy's two files; makes its control law."""

    name: str
    model: bytes
    inputs: PolicyInputs

    @classmethod
    def read(cls, place: str) -> "OnnxFile":
        """Read FILE.onnx and FILE.toml, or raise PolicyError."""
        path = Path(place)
        try:
            model = read_bytes(path)
        except OSError as error:
            raise PolicyError(f"controller {place}: {error.strerror}") from error
        table = path.with_suffix(".toml")
        if not table.is_file():
            raise PolicyError(f"controller {place}: {table} is missing: write it with colibri gym export {place}")
        return cls(place, model, read_toml(table, PolicyInputs, PolicyError))

    @property
    def __name__(self) -> str:
        return Path(self.name).name

    @property
    def sha256(self) -> str:
        return sha256(self.model + msgspec.json.encode(self.inputs)).hexdigest()

    def __call__(self, settings: Mapping[str, Any], vehicle: Vehicle, clock: Clock) -> "OnnxLaw":
        return OnnxLaw(self, settings, vehicle, clock)


class OnnxLaw(PolicyLaw):
    """A control law by an ONNX model: observation, (1, n) float32, to action, (1, a)."""

    def __init__(self, file: OnnxFile, settings: Mapping[str, Any], vehicle: Vehicle, clock: Clock) -> None:
        self._file = file
        super().__init__(settings, vehicle, clock)
        self._session, self._input = session_of(file.name, file.model)
        shapes = [it.shape[-1:] for it in (self._session.get_inputs()[0], self._session.get_outputs()[0])]
        wanted = [[self._seen.size], [self._actions]]
        for what, given, right in zip(("observations", "actions"), shapes, wanted, strict=True):
            if isinstance(given[0] if given else None, int) and given != right:
                raise PolicyError(f"controller {file.name}: the model has {given[0]} {what}, its TOML file {right[0]}")

    @property
    def _inputs(self) -> PolicyInputs:
        return self._file.inputs

    def act(self, observation: NDArray[np.float32]) -> Any:
        return self._session.run(None, {self._input: observation[None]})[0][0]

    @cached_property
    def __name__(self) -> str:
        return self._file.__name__


def session_of(name: str, model: bytes) -> tuple[Any, str]:
    """Return a session of ONNX Runtime on one thread, and the name of its only input."""
    try:
        import onnxruntime  # type: ignore[import-untyped] # of the extra, and slow to load
    except ModuleNotFoundError as error:
        raise PolicyError(f"controller {name} needs ONNX Runtime: pip install 'colibri-sitl[onnx]'") from error
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
        (given,) = session.get_inputs()
    except Exception as error:  # of ONNX Runtime, which has many kinds
        words = " ".join(str(error).split())
        raise PolicyError(f"controller {name} is not a policy: {shown(words, 200)}") from error
    if given.type != "tensor(float)":
        raise PolicyError(f"controller {name}: its input must be float32, not {given.type}")
    return session, given.name
