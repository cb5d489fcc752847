"""Colibri: a quadrotor autopilot by LPV model predictive control, and the plant it flies, over MAVLink."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.analysis import Recording, read_recording
    from colibri.autopilot import (
        Active,
        AttitudeController,
        AttitudeDemand,
        AutopilotError,
        Controller,
        Decision,
        Diagnostics,
        Fallback,
        Horizon,
        Mixer,
        Preview,
        Profile,
        QpStatus,
        Track,
        VehicleState,
        controller_names,
        load_controller,
        load_profile,
        track,
    )
    from colibri.common import Error, InFlightError, Table, read_settings
    from colibri.flights import FlightPlan, fly_plan
    from colibri.mavlink import MavlinkError
    from colibri.plant import PlantError, Vehicle, load_vehicle, vehicle_names
    from colibri.sitl import Sitl, SitlError
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "colibri.analysis": "Recording read_recording",
            "colibri.autopilot": (
                "Active AttitudeController AttitudeDemand AutopilotError Controller Decision Diagnostics Fallback "
                "Horizon Mixer Preview Profile QpStatus Track VehicleState controller_names load_controller "
                "load_profile track"
            ),
            "colibri.common": "Error InFlightError Table read_settings",
            "colibri.flights": "FlightPlan fly_plan",
            "colibri.mavlink": "MavlinkError",
            "colibri.plant": "PlantError Vehicle load_vehicle vehicle_names",
            "colibri.sitl": "Sitl SitlError",
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
