"""The thesis's LPV model of attitude: `colibri.lpv.model(vehicle, point)`."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.autopilot.control.thesis.lpv_model import HOVER as HOVER
    from colibri.autopilot.control.thesis.lpv_model import INPUTS as INPUTS
    from colibri.autopilot.control.thesis.lpv_model import OUTPUTS as OUTPUTS
    from colibri.autopilot.control.thesis.lpv_model import STATES as STATES
    from colibri.autopilot.control.thesis.lpv_model import LpvModel as LpvModel
    from colibri.autopilot.control.thesis.lpv_model import Point as Point
    from colibri.autopilot.control.thesis.lpv_model import model as model
else:
    __getattr__, __dir__ = public(__name__)
