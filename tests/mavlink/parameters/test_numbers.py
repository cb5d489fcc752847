from pathlib import Path

from colibri.mavlink.parameters.numbers import Number, read_numbers
from colibri.mavlink.parameters.store import ParamType

TABLE = """name,path,default,unit,minimum,maximum,scale,description,values
A_REAL,body.inertia.2,0.5,g m^2,-1.0,1e3,1e-3,"One, two",
A_CHOICE,,1,,0,2,,Choice,0=Off|1=On|2=Off at night
"""


def test_empty_cells_are_defaults_and_numbers_keep_their_kind(tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text(TABLE, encoding="ascii")
    real, choice = read_numbers(tmp_path / "table.csv")
    assert real == Number("A_REAL", ("body", "inertia", 2), "g m^2", -1.0, 1e3, "One, two", 1e-3, default=0.5)
    assert choice.values == ((0, "Off"), (1, "On"), (2, "Off at night"))
    kinds = [number.parameter(number.default).kind for number in (real, choice)]
    assert kinds == [ParamType.REAL, ParamType.INT]


def test_bounds_widen_to_include_the_default() -> None:
    parameter = Number("WIDE", minimum=0.0, maximum=1.0, description="Wide").parameter(5.0)
    assert (parameter.minimum, parameter.maximum) == (0.0, 5.0)
