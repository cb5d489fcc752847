"""Charge and voltage from a model driven by rotor commands, or as reported."""

from math import nan

import numpy as np

from colibri.autopilot.control.vehicle_model.battery import BatteryModel, charged, estimated
from colibri.common.types import PerRotor
from colibri.mavlink.hil.plant_status import PlantBattery
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.telemetry.snapshot import CHARGE_OK, BatteryState
from colibri.plant.vehicle.description import Vehicle

_CELL_V = 4.2
_SECONDS_PER_HOUR = 3600.0
_MIN_CURRENT_A = 0.01
_VOLTAGE = "SIM_BATT_VOLTAGE"
_SAG = 0.03  # tolerance, as a part of the full voltage: the model's rotors do not lag


class BatteryMonitor:
    """Integrates the charge taken; `battery` is None if the vehicle, or the plant, has none."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._model = BatteryModel(vehicle)
        self.battery = vehicle.battery
        self._cells = 0 if vehicle.battery is None else max(1, round(vehicle.battery.full_voltage_v / _CELL_V))
        self.energy_wh = 0.0
        self._now = self._model.terminal(0.0, np.zeros(vehicle.rotors.count))
        self._vehicle = vehicle
        self._is_reported = False
        self._sag_v = 0.0
        self.charge_ah = 0.0
        self._simulated_v: float | None = None

    def adopt(self, parameters: Parameters) -> None:
        """Have the voltage of SIM_BATT_VOLTAGE, once that is set."""
        is_set = _VOLTAGE in parameters and parameters[_VOLTAGE] != parameters.default(_VOLTAGE)
        self._simulated_v = float(parameters[_VOLTAGE]) if is_set else None

    def receive(self, reported: PlantBattery) -> None:
        if not reported.exists:
            self.battery = None
        if self.battery is None:
            return
        model_ah = self.charge_ah if self._is_reported else reported.used_ah
        self.charge_ah, self._is_reported = estimated(model_ah, reported.used_ah, self._vehicle), True
        sag_v = reported.voltage_v - self._now[0]
        self._sag_v = sag_v if abs(sag_v) > _SAG * self.battery.full_voltage_v else 0.0

    def resume(self, charge_ah: float, energy_wh: float) -> None:
        self.energy_wh = energy_wh
        if self._is_reported:
            return
        self.charge_ah = charge_ah
        self._now = self._model.terminal(charge_ah, np.zeros(self._vehicle.rotors.count))

    def run(self, controls: PerRotor, duration_s: float) -> None:
        """Integrate with `controls` relative to top speed."""
        voltage_v, current_a = self._now = self._model.terminal(self.charge_ah, np.array(controls))
        self.charge_ah = charged(self.charge_ah, current_a, duration_s)
        self.energy_wh += voltage_v * current_a * duration_s / _SECONDS_PER_HOUR

    @property
    def left(self) -> float:
        if self.battery is None:
            return 1.0
        return max(0.0, 1.0 - self.charge_ah / self.battery.capacity_ah)

    @property
    def voltage_v(self) -> float:
        return max(0.0, self._now[0] + self._sag_v) if self._simulated_v is None else self._simulated_v

    def state(self, charge_state: int = CHARGE_OK) -> BatteryState | None:
        if self.battery is None:
            return None
        left, current_a = self.left, self._now[1]
        left_ah = left * self.battery.capacity_ah
        left_s = left_ah / current_a * _SECONDS_PER_HOUR if current_a > _MIN_CURRENT_A else nan
        taken = self.charge_ah, left, left_s, self.energy_wh
        return BatteryState(self._cells, self.voltage_v, current_a, *taken, charge_state)
