"""Whatever type an argument of the Python API has: it is read, or refused in one line."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import colibri
from colibri.campaigns.definition import CampaignTables, campaign_of, read_seeds, tables_of
from tests.support.campaigns import Hovers, planned
from tests.support.refusals import refusal_of

anything: Any = colibri
VEHICLE, PROFILE = colibri.load_vehicle("hummingbird"), colibri.load_profile("flight")
WRONG: tuple[object, ...] = (5, None, object(), ["flight"], b"flight", {}, np.zeros(3))
LOADERS: dict[str, Callable[[Any], Any]] = {
    "load_profile": colibri.load_profile,
    "load_vehicle": colibri.load_vehicle,
    "load_controller": colibri.load_controller,
    "track": colibri.track,
    "read_recording": colibri.read_recording,
    "Mixer": colibri.Mixer,
    "FlightPlan.of": colibri.FlightPlan.of,
    "fly_plan": colibri.fly_plan,
    "Vehicle.replace": lambda given: VEHICLE.replace(given, 1.0),
    "Profile.replace": lambda given: PROFILE.replace(given, 1.0),
    "mass": lambda given: VEHICLE.replace("body.mass_kg", given),
    "read_settings": lambda given: anything.read_settings([given], dict),
    "campaign": lambda given: anything.campaign(5 if given is None else given),
    "campaign out": lambda given: anything.campaign(fly={"track": "hover"}, out=5 if given is None else given),
    "campaign workers": lambda given: anything.campaign(fly={"track": "hover"}, workers=[given]),
    "campaign executor": lambda given: colibri.campaign(fly={"track": "hover"}, executor=[given]),
    "tune": lambda given: anything.tune(5 if given is None else given),
    "metrics": lambda given: planned(metrics=given if given is not None else 5),
    "seeds": lambda given: planned(seeds=["x", given]),
    "preview": lambda given: colibri.fly("hover", controller=type("Law", (Hovers,), {"preview": given})),
    "previews": lambda given: colibri.fly(
        "hover", controller=type("Law", (Hovers,), {"preview": anything.Preview(10_000, [given])})
    ),
    "interval": lambda given: colibri.fly("hover", controller=type("Law", (Hovers,), {"control_interval_us": given})),
}
OPTIONS = ("wind", "gusts", "start", "seed", "duration", "vehicle", "profile", "solver", "feedback", "link", "without")


@pytest.mark.parametrize("name", LOADERS)
@pytest.mark.parametrize("given", WRONG, ids=lambda given: type(given).__name__)
def test_a_wrong_type_is_refused_in_one_line(name: str, given: object) -> None:
    assert refusal_of(LOADERS[name], given)


@pytest.mark.parametrize("option", OPTIONS)
@pytest.mark.parametrize("given", [object(), [object()], np.full(2, np.nan), {"a": 1}, b"x", (5,), True])
def test_an_option_of_a_wrong_type_is_refused_in_one_line(option: str, given: object) -> None:
    said = refusal_of(colibri.fly, "hover", **{option: given})
    assert said.startswith(f"{option}: ")
    assert "Literal" not in said


@pytest.mark.parametrize("wind", [(5, 270), [5, 270], np.array([5.0, 270.0]), np.array([5, 270])])
def test_a_wind_may_be_two_numbers(wind: Any) -> None:
    assert colibri.FlightSpec.of("hover", wind=wind) == colibri.FlightSpec.of("hover", wind="5@270")
    with pytest.raises(colibri.Error, match="the direction 0 to 360 degrees, not "):
        colibri.FlightSpec.of("hover", wind=(5, 400))


NUMBERS = (
    [0.7, 0.8],
    (0.7, 0.8),
    np.array([0.7, 0.8]),
    [np.float64(0.7), np.float64(0.8)],
    {"linspace": np.array([0.7, 0.8, 2])},
)


@pytest.mark.parametrize("values", NUMBERS)
def test_a_grid_takes_numbers_and_arrays_of_numpy(values: Any) -> None:
    tables = tables_of(CampaignTables, None, {"grid": {"track": "hover", "plant-vehicle.body.mass_kg": values}})
    assert campaign_of(tables).grid["plant-vehicle.body.mass_kg"] == (0.7, 0.8)


@pytest.mark.parametrize("seeds", [range(3), [0, 1, 2], (0, 1, 2), np.arange(3), [np.int64(0), 1, 2], "0-2"])
def test_seeds_take_ranges_and_arrays(seeds: Any) -> None:
    assert tuple(read_seeds(seeds)) == (0, 1, 2)


def test_many_seeds_and_values_are_not_expanded() -> None:
    assert planned(seeds="1-1000000000").flights == 10**9
    with pytest.raises(colibri.Error, match="latency: at most 1000000 values, not range"):
        planned(grid={"track": "hover", "latency": range(10**30)})
    with pytest.raises(colibri.Error, match=r"^seeds: must be FIRST-LAST"):
        planned(seeds=f"1-{10**30}")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("body.mass_kg", np.float32(0.5)),
        ("body.mass_kg", np.array(0.5)),
        ("body.inertia_kg_m2", np.array([1.0, 2.0, 2.0])),
        ("body.inertia_kg_m2", range(1, 4)),
        ("rotors.strength", (1, 1, np.float32(0.5), 1)),
    ],
)
def test_replace_takes_numbers_and_arrays_of_numpy(key: str, value: Any) -> None:
    assert VEHICLE.replace(key, value) != VEHICLE
    assert PROFILE.replace("controllers.Own", {"gain": value}).table("Own")["gain"] == (
        value.tolist() if hasattr(value, "tolist") else value
    )


def test_objects_of_one_name_are_values_of_a_grid() -> None:
    light, heavy = (VEHICLE.replace("body.mass_kg", mass) for mass in (0.6, 0.8))
    assert light.name == heavy.name == "AscTec Hummingbird*"
    found = planned(grid={"track": "hover", "plant_vehicle": [light, heavy]}, fly={"duration": 0.2})
    assert [each.name for each in found.grid["plant_vehicle"]] == [f"AscTec Hummingbird* ({place})" for place in (1, 2)]
    assert [point.settings["plant_vehicle"] for point in found.points()] == [light, heavy]
    with pytest.raises(colibri.Error, match="is there twice"):
        planned(grid={"track": "hover", "plant_vehicle": [light, light]})


def test_a_script_without_a_guard_ends_with_one_line(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import colibri, threading\n"
        "threading.Thread(target=threading.Event().wait, daemon=True).start()\n"  # so nothing is forked
        'colibri.campaign(fly={"track": "hover", "duration": 0.1}, workers=1)\n'
    )
    ran = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert ran.returncode == 1
    assert ran.stderr == (
        "colibri: error: worker processes cannot load the script: flights must begin under "
        '`if __name__ == "__main__":`\n'
    )
