"""Faults of one vehicle by MAV_CMD_INJECT_FAILURE, each at an instant between two frames."""

from colibri.mavlink.hil.faults import ALL, BATTERY, MOTOR, OFF, OK, SENSORS, STUCK, WRONG, Fault, judged
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.plant_status import FaultResult
from colibri.mavlink.wire.dialect import RESULT_ACCEPTED, RESULT_UNSUPPORTED
from colibri.mavlink.wire.refusal import Refusal
from colibri.plant.events import equipment
from colibri.plant.physics.world import Physics, World
from colibri.plant.sensors.faults import SensorFaults
from colibri.plant.vehicle.description import Vehicle


class Faults:
    """Active faults of one vehicle."""

    def __init__(self, vehicle: Vehicle, physics: Physics, feedback: Feedback, *, seed: int) -> None:
        self._physics, self._battery = physics, vehicle.battery
        self.sensors = SensorFaults(seed, vehicle.sensors)
        self.parts = equipment(vehicle, on_sensors=feedback is Feedback.SENSORS)
        self._taken_ah = 0.0

    def inject(self, asked: Fault, world: World) -> tuple[World, FaultResult]:
        fault = judged(asked, self.parts, len(world.rotor_speeds))
        if isinstance(fault, Refusal):
            return world, FaultResult(asked.unit, asked.kind, fault.result)
        if fault.unit in SENSORS and fault.unit not in self.sensors.units:
            return world, FaultResult(asked.unit, asked.kind, RESULT_UNSUPPORTED)
        if fault.unit == MOTOR:
            self._on_rotors(fault, world)
        elif fault.unit == BATTERY:
            world = self._on_battery(fault, world)
        else:
            self.sensors.begin(fault, world.time_us)
        return world, FaultResult(fault.unit, fault.kind, RESULT_ACCEPTED)

    def _on_rotors(self, fault: Fault, world: World) -> None:
        chosen = range(len(world.rotor_speeds)) if fault.instance == ALL else (fault.instance - 1,)
        for rotor in chosen:
            held = {OFF: 0.0, STUCK: world.rotor_speeds[rotor]}.get(fault.kind)
            self._physics.hold_rotor(rotor, held)
            self._physics.weaken_rotor(rotor, fault.values[0] if fault.kind == WRONG else 1.0)

    def _on_battery(self, fault: Fault, world: World) -> World:
        assert self._battery is not None, "what there is none of does not fail"
        left, resistance = fault.values[:2] if fault.kind == WRONG else (0.0, 1.0)
        used_ah = world.charge_used_ah - self._taken_ah
        after_ah = used_ah if fault.kind == OK else max(used_ah, (1.0 - left) * self._battery.capacity_ah)
        self._taken_ah = after_ah - used_ah
        self._physics.resist(resistance)
        return world._replace(charge_used_ah=after_ah)
