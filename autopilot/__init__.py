"""The autopilot: planner, LPV-MPC control law, and the process that flies a plant with them."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.autopilot.control.interface import Active as Active
    from colibri.autopilot.control.interface import AttitudeController as AttitudeController
    from colibri.autopilot.control.interface import AttitudeDemand as AttitudeDemand
    from colibri.autopilot.control.interface import Controller as Controller
    from colibri.autopilot.control.interface import Decision as Decision
    from colibri.autopilot.control.interface import Diagnostics as Diagnostics
    from colibri.autopilot.control.interface import Fallback as Fallback
    from colibri.autopilot.control.interface import Horizon as Horizon
    from colibri.autopilot.control.interface import Preview as Preview
    from colibri.autopilot.control.interface import VehicleState as VehicleState
    from colibri.autopilot.control.parts.rate_loop import RateLoop as RateLoop
    from colibri.autopilot.control.parts.rotor_frame import RotorFrame as RotorFrame
    from colibri.autopilot.control.policy import PolicyInputs as PolicyInputs
    from colibri.autopilot.control.policy import PolicyLaw as PolicyLaw
    from colibri.autopilot.control.profile import Profile as Profile
    from colibri.autopilot.control.profile import ProfileError as ProfileError
    from colibri.autopilot.control.profile import load_profile as load_profile
    from colibri.autopilot.control.qp import QpStatus as QpStatus
    from colibri.autopilot.control.qp import SolverError as SolverError
    from colibri.autopilot.control.qp import installed_solvers as installed_solvers
    from colibri.autopilot.control.registry import ControllerError as ControllerError
    from colibri.autopilot.control.registry import DecisionError as DecisionError
    from colibri.autopilot.control.registry import controller_names as controller_names
    from colibri.autopilot.control.registry import load_controller as load_controller
    from colibri.autopilot.control.vehicle_model.mixer import Mixer as Mixer
    from colibri.autopilot.core.autopilot import Autopilot as Autopilot
    from colibri.autopilot.core.copter import copter_autopilot as copter_autopilot
    from colibri.autopilot.core.step import Step as Step
    from colibri.autopilot.core.track_stages import track_autopilot as track_autopilot
    from colibri.autopilot.errors import AutopilotError as AutopilotError
    from colibri.autopilot.guidance.trajectories.registry import TrackError as TrackError
    from colibri.autopilot.guidance.trajectories.registry import track as track
    from colibri.autopilot.guidance.trajectories.registry import track_names as track_names
    from colibri.autopilot.guidance.trajectories.taylor import TaylorSeries as TaylorSeries
    from colibri.autopilot.guidance.trajectories.tracks import Track as Track
    from colibri.autopilot.guidance.trajectories.tracks import TrackOptions as TrackOptions
else:
    __getattr__, __dir__ = public(__name__)
