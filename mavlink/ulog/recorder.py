"""A recorder of the vehicle's snapshots, texts and parameters as ULog."""

from collections.abc import Mapping
from math import nan

from colibri.common.compiled_rotations import euler_from_quaternion
from colibri.mavlink.parameters.store import Parameters, Value
from colibri.mavlink.telemetry.snapshot import CHARGE_OK, BatteryState, TelemetrySnapshot
from colibri.mavlink.ulog import messages, topics
from colibri.mavlink.ulog.blocks import Thinning
from colibri.mavlink.ulog.flight_topics import split
from colibri.mavlink.ulog.log import TopicLog, beginning
from colibri.mavlink.ulog.samples import SampleBlocks, SensingBlocks, VehicleStatus, sensing_numbers, status_message
from colibri.mavlink.ulog.topics import record

STATUS_EVERY_US = 1_000_000
_NO_REFERENCE = (nan,) * 3


class Recorder:
    """Writes snapshots to a log; raises `LogError` if writing fails."""

    def __init__(
        self, log: TopicLog, vehicle: str, system_id: int, parameters: Parameters, *, with_battery: bool
    ) -> None:
        self._log, self._vehicle, self._system_id, self._parameters = log, vehicle, system_id, parameters
        self._with_battery = with_battery
        self._samples, self._sensings = SampleBlocks(), SensingBlocks()
        self._revision, self._values = parameters.revision, dict(parameters.values)
        self._status: VehicleStatus | None = None
        self._status_us = 0
        self._thinning = Thinning()

    def begin(self) -> bytes:
        self._status, self._thinning = None, Thinning()
        self._revision, self._values = self._parameters.revision, dict(self._parameters.values)
        return beginning(self._vehicle, self._values)

    def update(self, snapshot: TelemetrySnapshot) -> None:
        self._record_parameters()
        self._record_status(snapshot)
        if not self._thinning.is_due(snapshot.time_us):
            return
        if self._samples.rotors != len(snapshot.controls):
            self._samples = SampleBlocks(len(snapshot.controls))
        self._log.add(self._samples, sample_row(snapshot))
        if snapshot.sensed is not None and snapshot.estimator is not None:
            row = sensing_numbers(snapshot.time_us, snapshot.sensed, snapshot.estimator)
            self._log.add(self._sensings, row)

    def say(self, time_us: int, severity: int, text: str) -> None:
        self._log.append(messages.SYNC + messages.logged_string(time_us, severity, text))

    def flush(self) -> None:
        self._log.flush()

    def _record_parameters(self) -> None:
        if self._parameters.revision == self._revision:
            return
        known, values = self._values, self._parameters.values
        self._revision, self._values = self._parameters.revision, dict(values)
        changed: Mapping[str, Value] = {name: value for name, value in values.items() if known.get(name) != value}
        self._log.append(messages.SYNC + messages.parameters(changed))

    def _record_status(self, s: TelemetrySnapshot) -> None:
        """Record a new status, or every second, with the battery; then flush the log."""
        now_us = s.time_us
        status = VehicleStatus(s.armed, s.px4_mode, s.failsafe, s.armable, s.flight_started_us, s.takeoff_us)
        if status == self._status and 0 <= now_us - self._status_us < STATUS_EVERY_US:
            return
        self._status, self._status_us = status, now_us
        self._log.flush()
        self._log.append(status_message(now_us, status, self._system_id, len(s.controls)))
        if s.battery is not None and self._with_battery:
            self._log.append(battery_message(now_us, s.battery))


def sample_row(s: TelemetrySnapshot) -> tuple[float, ...]:
    steered, solver = s.setpoint, s.solver
    controls, others = split(s.controls if s.armed else (nan,) * len(s.controls))
    attitude = _NO_REFERENCE if s.solver.step_time_s == 0.0 else euler_from_quaternion(steered.attitude)
    return (
        s.time_us,
        *(*s.position_enu_m, *s.velocity_enu_m_s, *s.attitude, *s.rate_flu_rad_s),
        *controls,
        *(*steered.position_enu_m, *steered.velocity_enu_m_s, *steered.acceleration_enu_m_s2),
        *(steered.yaw_rad, steered.yaw_rate_rad_s, *attitude),
        *(solver.status, solver.fallback, 1e6 * solver.solve_time_s, 1e6 * solver.step_time_s, solver.cost),
        *(solver.slack, *solver.active, s.delay_us, solver.mass_kg, solver.path_lag_s),
        nan if solver.iterations < 0 else solver.iterations,
        *others,
    )


def battery_message(time_us: int, battery: BatteryState) -> bytes:
    taken = (battery.voltage_v, battery.current_a, 1e3 * battery.used_ah, battery.remaining, battery.remaining_s)
    warning = max(battery.charge_state - CHARGE_OK, 0)
    return messages.SYNC + record(topics.BATTERY, time_us, *taken, True, battery.cells, warning)
