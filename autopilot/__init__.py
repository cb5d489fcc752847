"""The autopilot: planner, LPV-MPC control law, and the process that flies a plant with them."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
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
    from colibri.autopilot.control.profile import Profile, ProfileError, load_profile
    from colibri.autopilot.control.qp import QpStatus, SolverError, installed_solvers
    from colibri.autopilot.control.registry import ControllerError, DecisionError, controller_names, load_controller
    from colibri.autopilot.control.vehicle_model.mixer import Mixer
    from colibri.autopilot.core.copter import Copter
    from colibri.autopilot.core.step import Step
    from colibri.autopilot.core.track_autopilot import Autopilot
    from colibri.autopilot.errors import AutopilotError
    from colibri.autopilot.guidance.trajectories.tracks import Track, TrackError, track
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "colibri.autopilot.control.interface": (
                "Active AttitudeController AttitudeDemand Controller Decision Diagnostics Fallback Horizon "
                "Preview VehicleState"
            ),
            "colibri.autopilot.control.profile": "Profile ProfileError load_profile",
            "colibri.autopilot.control.qp": "QpStatus SolverError installed_solvers",
            "colibri.autopilot.control.registry": "ControllerError DecisionError controller_names load_controller",
            "colibri.autopilot.control.vehicle_model.mixer": "Mixer",
            "colibri.autopilot.core.copter": "Copter",
            "colibri.autopilot.core.step": "Step",
            "colibri.autopilot.core.track_autopilot": "Autopilot",
            "colibri.autopilot.errors": "AutopilotError",
            "colibri.autopilot.guidance.trajectories.tracks": "Track TrackError track",
        },
    )

__all__ = [
    "Active",
    "AttitudeController",
    "AttitudeDemand",
    "Autopilot",
    "AutopilotError",
    "Controller",
    "ControllerError",
    "Copter",
    "Decision",
    "DecisionError",
    "Diagnostics",
    "Fallback",
    "Horizon",
    "Mixer",
    "Preview",
    "Profile",
    "ProfileError",
    "QpStatus",
    "SolverError",
    "Step",
    "Track",
    "TrackError",
    "VehicleState",
    "controller_names",
    "installed_solvers",
    "load_controller",
    "load_profile",
    "track",
]
