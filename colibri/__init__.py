"""Colibri: a quadrotor autopilot by LPV model predictive control, and the plant it flies, over MAVLink."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.analysis.recording import Recording, read_recording
    from colibri.autopilot.control.interface import (
        Active,
        AttitudeController,
        AttitudeDemand,
        Controller,
        Decision,
        Diagnostics,
        Fallback,
        Horizon,
        Preview,
        VehicleState,
    )
    from colibri.autopilot.control.profile import Profile, load_profile
    from colibri.autopilot.control.qp import QpStatus
    from colibri.autopilot.control.registry import controller_names, load_controller
    from colibri.autopilot.control.vehicle_model.mixer import Mixer
    from colibri.autopilot.errors import AutopilotError
    from colibri.autopilot.guidance.trajectories.tracks import Track, track
    from colibri.common.config import Table, read_settings
    from colibri.common.errors import Error, InFlightError
    from colibri.flights.fly import fly_plan
    from colibri.flights.plan import FlightPlan
    from colibri.mavlink.errors import MavlinkError
    from colibri.plant.errors import PlantError
    from colibri.plant.vehicle.description import Vehicle, load_vehicle, vehicle_names
    from colibri.sitl.errors import SitlError
    from colibri.sitl.vehicle import Sitl
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "colibri.analysis.recording": "Recording read_recording",
            "colibri.autopilot.control.interface": (
                "Active AttitudeController AttitudeDemand Controller Decision Diagnostics Fallback Horizon "
                "Preview VehicleState"
            ),
            "colibri.autopilot.control.profile": "Profile load_profile",
            "colibri.autopilot.control.qp": "QpStatus",
            "colibri.autopilot.control.registry": "controller_names load_controller",
            "colibri.autopilot.control.vehicle_model.mixer": "Mixer",
            "colibri.autopilot.errors": "AutopilotError",
            "colibri.autopilot.guidance.trajectories.tracks": "Track track",
            "colibri.common.config": "Table read_settings",
            "colibri.common.errors": "Error InFlightError",
            "colibri.flights.fly": "fly_plan",
            "colibri.flights.plan": "FlightPlan",
            "colibri.mavlink.errors": "MavlinkError",
            "colibri.plant.errors": "PlantError",
            "colibri.plant.vehicle.description": "Vehicle load_vehicle vehicle_names",
            "colibri.sitl.errors": "SitlError",
            "colibri.sitl.vehicle": "Sitl",
        },
    )

__all__ = [
    "Active",
    "AttitudeController",
    "AttitudeDemand",
    "AutopilotError",
    "Controller",
    "Decision",
    "Diagnostics",
    "Error",
    "Fallback",
    "FlightPlan",
    "Horizon",
    "InFlightError",
    "MavlinkError",
    "Mixer",
    "PlantError",
    "Preview",
    "Profile",
    "QpStatus",
    "Recording",
    "Sitl",
    "SitlError",
    "Table",
    "Track",
    "Vehicle",
    "VehicleState",
    "controller_names",
    "fly_plan",
    "load_controller",
    "load_profile",
    "load_vehicle",
    "read_recording",
    "read_settings",
    "track",
    "vehicle_names",
]
