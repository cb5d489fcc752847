"""Parameters chosen before a flight, by name."""

from collections.abc import Mapping

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.errors import AutopilotError
from colibri.autopilot.parameters.definitions import Numbers, definitions
from colibri.common.errors import unknown
from colibri.mavlink.parameters.store import Parameters, ParamType, Value
from colibri.plant.vehicle.description import Vehicle


class ChoiceError(AutopilotError):
    """A parameter is unknown, has an invalid value, or needs a ground station."""


def with_parameters(
    profile: Profile, vehicle: Vehicle, values: Mapping[str, Value], *, served: bool
) -> tuple[Profile, Vehicle]:
    """Return the profile and the autopilot's vehicle with these parameters, or raise ChoiceError or ImpossibleError."""
    numbers = Numbers(profile, vehicle)
    known = {each.name: each for each in definitions(profile, vehicle)}
    for name, value in values.items():
        if name not in known:
            raise ChoiceError(unknown("parameter", name, known))
        each = known[name]
        whole = each.kind == ParamType.INT
        if not each.minimum <= value <= each.maximum or (whole and value != int(value)):
            kind = "a whole number" if whole else "a number"
            raise ChoiceError(f"{name}: must be {kind} from {each.minimum:g} to {each.maximum:g}, not {value!r}")
        if not served and name not in numbers.defaults:
            raise ChoiceError(
                f"{name}: acts with ground stations only: give --gcs, or fly colibri sitl or the fixture sitl"
            )
    parameters = Parameters([*known.values()])
    whole_names = {name for name, each in known.items() if each.kind == ParamType.INT}
    parameters.load({name: int(value) if name in whole_names else value for name, value in values.items()})
    return numbers.applied(parameters.values)
