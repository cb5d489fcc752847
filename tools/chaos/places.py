"""Places for exceptions: methods by module and dotted name."""

from importlib import import_module
from math import inf
from typing import Any

PACKAGE = "colibri."

PLACES: tuple[str, ...] = (
    "autopilot.estimation.state_source:StateSource.receive",
    "autopilot.estimation.estimator:Estimator._take_in",
    "autopilot.estimation.estimator:Estimator._publish",
    "autopilot.estimation.eskf:Filter.predict",
    "autopilot.estimation.eskf:Filter.fuse_fix",
    "autopilot.control.loop:ControlLoop.observe",
    "autopilot.core.supervision:Supervision.step",
    "autopilot.control.rotor_loss.rotor_loss:RotorLoss.look",
    "autopilot.control.rotor_loss.detector:RotorWatch.step",
    "autopilot.commander.needs:ModeNeeds.steered",
    "autopilot.commander.supervisor:Supervisor.position_known",
    "autopilot.commander.supervisor:Supervisor.step",
    "autopilot.commander.rules.failsafe_conditions:Conditions.look",
    "autopilot.commander.pilot:Pilot.sense",
    "autopilot.commander.pilot:Pilot.step",
    "autopilot.commander.pilot:Pilot.context",
    "autopilot.commander.pilot:Pilot.save",
    "autopilot.guidance.tasks.position:HoldTask.update",
    "autopilot.guidance.tasks.position:TaskSequence.update",
    "autopilot.guidance.tasks.position:TrackTask.update",
    "autopilot.guidance.tasks.position:LandTask.update",
    "autopilot.guidance.tasks.offboard:OffboardTask.update",
    "autopilot.commander.missions:MissionTask.update",
    "autopilot.guidance.mission.executor:MissionExecutor.step",
    "autopilot.commander.flight.reference_generator:ReferenceGenerator.lead",
    "autopilot.commander.flight.ground_contact:GroundContact.watch",
    "autopilot.core.actuation:Actuation.decide",
    "autopilot.control.loop:ControlLoop.decide",
    "autopilot.control.loop:ControlLoop._command",
    "autopilot.control.lpv_mpc.law:LpvMpc.step",
    "autopilot.control.lpv_mpc.law:LpvMpc._inputs",
    "autopilot.control.lpv_mpc.targets:TargetBuilder.on_clock",
    "autopilot.control.lpv_mpc.mpc:Mpc.plan",
    "autopilot.control.lpv_mpc.mpc:Mpc.solve",
    "autopilot.core.report:Reporter.report",
    "autopilot.ground.battery_monitor:BatteryMonitor.run",
    "autopilot.ground.snapshots:SnapshotBuilder.take",
    "autopilot.ground.forecast:Forecaster.forecast",
    "autopilot.ground.stations:Stations.update",
    "autopilot.ground.stations:Stations.receive_status",
    "autopilot.ground.stations:Stations._tell",
    "autopilot.ground.onboard_log:OnboardLog.update",
    "autopilot.ground.fault_injection:Failures.take",
    "mavlink.node.hub:Hub.receive",
    "mavlink.node.hub:Hub.poll",
    "mavlink.streaming.service:StreamService.poll",
    "mavlink.streaming.heartbeat:HeartbeatService.poll",
    "mavlink.streaming.heartbeat:HeartbeatService.receive",
    "mavlink.services.command:CommandService.receive",
    "mavlink.setpoints.arbitration:StreamedService.receive",
    "mavlink.parameters.service:ParameterService.receive",
    "autopilot.core.subscription:Subscribers.adopt",
    "autopilot.core.subscription:Subscribers._calls",
    "autopilot.core.checkpoint:Checkpointer.record",
)


class ChaosError(Exception):
    """Thrown on purpose."""


class Thrower:
    """Throws in one place up to `times` exceptions while armed; `thrown` counts them."""

    def __init__(self, place: str, times: float = inf) -> None:
        module, _, dotted = place.partition(":")
        owner, _, self._name = dotted.partition(".")
        self._owner = getattr(import_module(PACKAGE + module), owner)
        self._method = vars(self._owner)[self._name]
        self._times = times
        self.thrown = 0

    def arm(self) -> None:
        def throwing(*args: Any, **options: Any) -> Any:
            if self.thrown >= self._times:
                return self._method(*args, **options)
            self.thrown += 1
            raise ChaosError(self._name)

        setattr(self._owner, self._name, throwing)

    def disarm(self) -> None:
        setattr(self._owner, self._name, self._method)
