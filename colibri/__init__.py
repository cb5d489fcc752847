"""Colibri: a multirotor autopilot with LPV model predictive control, and a plant, over MAVLink."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

__version__: str

if TYPE_CHECKING:
    from colibri.analysis import Recording as Recording
    from colibri.analysis import read_recording as read_recording
    from colibri.autopilot import Active as Active
    from colibri.autopilot import AttitudeController as AttitudeController
    from colibri.autopilot import AttitudeDemand as AttitudeDemand
    from colibri.autopilot import AutopilotError as AutopilotError
    from colibri.autopilot import Controller as Controller
    from colibri.autopilot import Decision as Decision
    from colibri.autopilot import Diagnostics as Diagnostics
    from colibri.autopilot import Fallback as Fallback
    from colibri.autopilot import Horizon as Horizon
    from colibri.autopilot import Mixer as Mixer
    from colibri.autopilot import PolicyInputs as PolicyInputs
    from colibri.autopilot import PolicyLaw as PolicyLaw
    from colibri.autopilot import Preview as Preview
    from colibri.autopilot import Profile as Profile
    from colibri.autopilot import QpStatus as QpStatus
    from colibri.autopilot import RateLoop as RateLoop
    from colibri.autopilot import RotorFrame as RotorFrame
    from colibri.autopilot import TaylorSeries as TaylorSeries
    from colibri.autopilot import Track as Track
    from colibri.autopilot import TrackOptions as TrackOptions
    from colibri.autopilot import VehicleState as VehicleState
    from colibri.autopilot import controller_names as controller_names
    from colibri.autopilot import load_controller as load_controller
    from colibri.autopilot import load_profile as load_profile
    from colibri.autopilot import track as track
    from colibri.autopilot import track_names as track_names
    from colibri.campaigns import CampaignError as CampaignError
    from colibri.campaigns import CampaignResults as CampaignResults
    from colibri.campaigns import campaign as campaign
    from colibri.common import Error as Error
    from colibri.common import InFlightError as InFlightError
    from colibri.common import Table as Table
    from colibri.common import read_settings as read_settings
    from colibri.conformance import check_controller as check_controller
    from colibri.conformance import check_vehicle as check_vehicle
    from colibri.experiments import Flight as Flight
    from colibri.experiments import fly as fly
    from colibri.experiments import load_flight as load_flight
    from colibri.flights import FlightPlan as FlightPlan
    from colibri.flights import FlightSpec as FlightSpec
    from colibri.flights import NoEffectWarning as NoEffectWarning
    from colibri.flights import fly_plan as fly_plan
    from colibri.mavlink import MavlinkError as MavlinkError
    from colibri.plant import PlantError as PlantError
    from colibri.plant import Vehicle as Vehicle
    from colibri.plant import load_vehicle as load_vehicle
    from colibri.plant import vehicle_names as vehicle_names
    from colibri.sitl import Sitl as Sitl
    from colibri.sitl import SitlError as SitlError
    from colibri.tuning import TuningError as TuningError
    from colibri.tuning import TuningResults as TuningResults
    from colibri.tuning import tune as tune
else:
    _public, __dir__ = public(__name__)

    def __getattr__(name):
        if name != "__version__":
            return _public(name)
        from importlib.metadata import version

        return version("colibri-sitl")
