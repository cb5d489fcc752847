"""The control loop: states from frames, one control law, and its rotor commands."""

from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.control.interface import (
    AT_REST,
    AttitudeController,
    AttitudeDemand,
    ChargeController,
    Clock,
    CompiledController,
    Controller,
    Decision,
    Horizon,
    MassController,
    Pace,
    PathController,
    PlanController,
    QuietController,
    VehicleState,
)
from colibri.autopilot.control.law_files import table_of
from colibri.autopilot.control.profile import Profile, ProfileError
from colibri.autopilot.control.registry import (
    BuildError,
    DecisionError,
    Factory,
    LawError,
    check_answer,
    check_controller,
    check_preview,
    check_rotor_speeds,
    in_words,
    load_controller,
)
from colibri.autopilot.control.vehicle_model.battery import estimated
from colibri.autopilot.control.vehicle_model.rotor_lag import rotor_lag
from colibri.common.compiled_rotations import euler_from_quaternion
from colibri.common.config import SettingsError
from colibri.common.errors import Error
from colibri.common.records import Record, tuple_of
from colibri.common.rotations import nearest_turn
from colibri.common.serialization import of_bytes, to_bytes
from colibri.common.types import Array, PerRotor, Vector
from colibri.mavlink.hil.state import StateFrame
from colibri.plant.vehicle.description import Vehicle


class Seen(NamedTuple):
    """Motion at the last observation."""

    time_us: int
    velocity_enu_m_s: Vector
    acceleration_enu_m_s2: Vector


_ON_SENSORS_S = 0.02  # the estimator does not start with frames further apart than 0.05 s
_UNREAD = AT_REST[5:]  # of a state where the law does not read the motion: acceleration, rotor speeds; airborne
_UNSEEN = Seen(-1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class LoopRecord(Record, frozen=True):
    """State of a control loop to resume after a restart, as plain data."""

    yaw_rad: float  # unwrapped
    controls: PerRotor  # rotor speeds, in parts of the largest
    memory: bytes  # the control law's, serialised; empty if it is not plain data
    seen: Seen
    rotor_speeds: PerRotor  # of the model, vehicle's unit


class ControlLoop:
    """One control law flying one vehicle."""

    def __init__(
        self,
        profile: Profile,
        vehicle: Vehicle,
        clock: Clock,
        law: Factory | None = None,
        *,
        on_sensors: bool = False,
    ) -> None:
        self._name = profile.controller
        self.controller = build_controller(profile, vehicle, clock, law)
        if isinstance(self.controller, CompiledController):
            self.controller.warm_up()
        self.vehicle = vehicle
        self.preview = self.controller.preview
        check_preview(self._name, self.preview)
        self.takes_attitude = isinstance(self.controller, AttitudeController)
        self._shows_plan = True
        self.plan_columns = self.controller.plan_columns if isinstance(self.controller, PlanController) else None
        self._take_in(self.controller)
        self.control_interval_us = self.controller.control_interval_us
        wanted_s = profile.simulation.frame_interval_s or (_ON_SENSORS_S if on_sensors else None)
        self.frame_interval_us = _frame_interval_us(wanted_s, self.control_interval_us)  # divides the control interval
        self._memory: Any = None
        self._waited_us = 0
        self._reported_ah = 0.0
        self._is_plain = True
        self._yaw_rad = 0.0
        self._seen = _UNSEEN
        self._speeds = vehicle.rotors.stopped  # of the rotors' model at the next control sample
        self.controls = vehicle.rotors.stopped  # rotor speeds now, in parts of the largest

    def begin(self, rotor_speed: float, yaw_rad: float, *, afresh: bool = True) -> None:
        """Begin at a rotor speed (vehicle's unit) and yaw; `afresh` resets the charge to the battery's report."""
        before, self._memory = self._memory, self.controller.initial(rotor_speed)
        if self._charged is not None:
            charge_ah = self._reported_ah if afresh or before is None else self._charged.charge_ah(before)
            self._memory = self._charged.with_charge(self._memory, charge_ah)
        self._yaw_rad, self._seen = yaw_rad, _UNSEEN
        self._speeds = (rotor_speed,) * self.vehicle.rotors.count
        self._command(np.full(self.vehicle.rotors.count, rotor_speed))

    def begin_in_flight(self, yaw_rad: float) -> None:
        """Restart at hover speed; keep charge, mass and lag."""
        before = self._memory
        self.begin(self.vehicle.hover_speed, yaw_rad, afresh=False)
        if before is None:
            return
        if self._weighing is not None:
            self._memory = self._weighing.with_mass(self._memory, self._weighing.mass_kg(before))
        if self._waiting is not None:
            self._memory = self._waiting.with_lag(self._memory, self._waiting.lag_us(before))

    def know_charge(self, used_ah: float) -> None:
        self._reported_ah = used_ah
        if self._charged is not None and self._memory is not None:
            charge_ah = estimated(self._charged.charge_ah(self._memory), used_ah, self.vehicle)
            self._memory = self._charged.with_charge(self._memory, charge_ah)

    @property
    def charge_ah(self) -> float:
        """Charge taken: the law's estimate, else the battery's report."""
        if self._charged is None or self._memory is None:
            return self._reported_ah
        return self._charged.charge_ah(self._memory)

    @property
    def lag_us(self) -> int:
        return 0 if self._waiting is None or self._memory is None else self._waiting.lag_us(self._memory)

    @property
    def path_speed(self) -> float:
        return 1.0 if self._waiting is None or self._memory is None else self._waiting.path_speed(self._memory)

    def take_waited_us(self) -> int:
        """Return the growth of the lag since the last call, µs."""
        waited_us, self._waited_us = self._waited_us, 0
        return waited_us

    def record(self) -> LoopRecord:
        memory = b""
        if self._is_plain:
            try:
                memory = to_bytes(self._memory)
            except TypeError:
                self._is_plain = False
        return LoopRecord(self._yaw_rad, self.controls, memory, self._seen, self._speeds)

    def resume(self, record: LoopRecord, *, seamless: bool) -> None:
        first = self.controller.initial(self.vehicle.hover_speed)
        kept = of_bytes(type(first), record.memory)
        self._memory = first if kept is None else kept
        if seamless and kept is not None:
            self._yaw_rad, self.controls = record.yaw_rad, record.controls
            self._seen, self._speeds = record.seen, record.rotor_speeds
        else:
            self.begin_in_flight(record.yaw_rad)

    def hide_plan(self) -> None:
        """Have the law leave its plan out of the diagnostics, if it can: nobody reads it."""
        self._shows_plan = False
        self._take_in(self.controller)

    def is_due(self, time_us: int) -> bool:
        return time_us % self.control_interval_us == 0

    def observe(self, frame: StateFrame) -> VehicleState:
        """Return the state of a frame, yaw unwrapped near the previous one."""
        time_us, attitude, rate = frame.time_us, frame.attitude, frame.rate_flu_rad_s
        position, velocity = frame.position_enu_m, frame.velocity_enu_m_s
        phi, theta, psi = euler_from_quaternion(attitude)
        self._yaw_rad = nearest_turn(psi, self._yaw_rad)
        euler = (phi, theta, self._yaw_rad)
        if not self._reads_motion:
            return tuple_of(VehicleState, (position, velocity, attitude, euler, rate, *_UNREAD))
        before_us, (vx, vy, vz), acceleration = self._seen
        if time_us != before_us:
            if before_us >= 0:
                x, y, z = velocity
                per_s = 1e6 / (time_us - before_us)
                acceleration = ((x - vx) * per_s, (y - vy) * per_s, (z - vz) * per_s)
            self._seen = Seen(time_us, velocity, acceleration)
        return VehicleState(position, velocity, attitude, euler, rate, acceleration, self._speeds)

    def decide(self, time_us: int, state: VehicleState, references: Horizon, pace: Pace = Pace.CLOCK) -> Decision:
        """Decide the rotor speeds to hold until the next control sample.

        Raises:
            DecisionError: The control law raised, or exceeded the rotors' limits.
        """
        try:
            if self._waiting is not None and pace is not Pace.CLOCK:
                return self._decide_on_path(self._waiting, time_us, state, references, pace)
            return self._take(time_us, self.controller.step(self._memory, time_us, state, references))
        except DecisionError:
            raise
        except (Exception, SystemExit) as error:
            raise self._raised(time_us, error) from error

    def _decide_on_path(
        self, law: PathController[Any], time_us: int, state: VehicleState, references: Horizon, pace: Pace
    ) -> Decision:
        if pace is Pace.WAITING:
            self._memory = law.with_lag(self._memory, 0)
        before_us = law.lag_us(self._memory)
        decision = self._take(time_us, law.step_on_path(self._memory, time_us, state, references))
        self._waited_us += law.lag_us(self._memory) - before_us
        return decision

    def decide_attitude(self, time_us: int, state: VehicleState, demand: AttitudeDemand) -> Decision:
        assert isinstance(self.controller, AttitudeController), "decided only where attitudes are taken"
        try:
            return self._take(time_us, self.controller.step_attitude(self._memory, time_us, state, demand))
        except DecisionError:
            raise
        except (Exception, SystemExit) as error:
            raise self._raised(time_us, error) from error

    def adopt(self, controller: Controller[Any], vehicle: Vehicle) -> None:
        """Switch to a law of the same kind and interval; keep the memory."""
        self.vehicle = vehicle
        self._take_in(controller)

    def _take_in(self, controller: Controller[Any]) -> None:
        self.controller = controller
        self.tilts_freely = bool(getattr(controller, "tilts_freely", False))
        self._reads_motion = vars(type(controller)).get("reads_motion", True)  # not that of a base class
        lag = rotor_lag(self.vehicle, controller.control_interval_us * 1e-6)
        self._lag = (lag.up, lag.down)
        if not self._shows_plan and isinstance(controller, QuietController) and "shows_plan" in vars(type(controller)):
            controller.shows_plan = False  # a subclass may read the plan
        self._charged = controller if isinstance(controller, ChargeController) else None
        self._weighing = controller if isinstance(controller, MassController) else None
        on_path = controller if isinstance(controller, PathController) else None
        self._waiting = on_path if on_path is not None and on_path.min_path_speed < 1.0 else None

    def _take(self, time_us: int, answer: tuple[Any, Decision]) -> Decision:
        check_answer(self._name, answer, time_us)
        self._memory, decision = answer
        self._command(decision.rotor_speeds, time_us)
        return decision

    def _raised(self, time_us: int, error: BaseException) -> LawError:
        return LawError(f"controller {self._name} raised at t = {time_us / 1e6:.3f} s: {in_words(error)}")

    def _command(self, rotor_speeds: Array, time_us: int | None = None) -> None:
        rotors = self.vehicle.rotors
        speeds, maximum = check_rotor_speeds(self._name, rotor_speeds, rotors, time_us), rotors.max_speed
        self.controls = tuple([speed / maximum for speed in speeds])
        if self._reads_motion:
            up, down = self._lag
            moving = zip(self._speeds, speeds, strict=True)
            self._speeds = tuple([now + (to - now) * (up if to > now else down) for now, to in moving])


def _frame_interval_us(wanted_s: float | None, control_interval_us: int) -> int:
    if wanted_s is None:
        return control_interval_us
    control_ms, wanted_ms = control_interval_us // 1000, round(wanted_s * 1e6) // 1000
    return 1000 * max(ms for ms in range(1, control_ms + 1) if control_ms % ms == 0 and ms <= wanted_ms)


def build_controller(profile: Profile, vehicle: Vehicle, clock: Clock, law: Factory | None = None) -> Controller[Any]:
    """Build the control law of a profile for a vehicle.

    Raises:
        ControllerError, ProfileError, SolverError: The law, its table, or its solver cannot be used.
    """
    factory = law or load_controller(profile.controller)
    try:
        controller = factory(profile.table(profile.controller), vehicle, clock)
    except SettingsError as error:
        if table_of(profile.controller) not in profile.controllers:
            known = ", ".join(profile.controllers)
            raise ProfileError(
                f"{profile.where} has no numbers for controller {profile.controller}, only for {known}: "
                f"choose another profile, or add a table controllers.{table_of(profile.controller)} to a copy of it"
            ) from error
        raise ProfileError(f"{profile.where}: controllers.{profile.controller}: {error}") from error
    except Error:
        raise
    except (Exception, SystemExit) as error:
        raise BuildError(f"controller {profile.controller} cannot be built: {in_words(error)}") from error
    check_controller(profile.controller, controller)
    return controller
