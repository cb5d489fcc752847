"""Conformance tests of a control law, and test flights of a vehicle file."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.conformance.check import Conformance as Conformance
    from colibri.conformance.check import check_controller as check_controller
    from colibri.conformance.loop_flight import held as held
    from colibri.conformance.loop_flight import rebuilt as rebuilt
    from colibri.conformance.loop_flight import restarted as restarted
    from colibri.conformance.step_records import FlownStep as FlownStep
    from colibri.conformance.step_records import flown_steps as flown_steps
    from colibri.conformance.step_records import jumped as jumped
    from colibri.conformance.subject import Result as Result
    from colibri.conformance.subject import Row as Row
    from colibri.conformance.subject import built as built
    from colibri.conformance.vehicle_check import VehicleCheck as VehicleCheck
    from colibri.conformance.vehicle_check import check_vehicle as check_vehicle
else:
    __getattr__, __dir__ = public(__name__)
