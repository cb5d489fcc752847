from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.mavlink.parameters.file import ParameterFileError, read, write
from colibri.mavlink.parameters.store import INT32_MAX, INT32_MIN, Parameter, Parameters, ParamType, float32
from tests.support.refusals import refusal_of


def parameters_of() -> Parameters:
    return Parameters(
        [
            Parameter(name="INTEGER", kind=ParamType.INT, default=0, description=""),
            Parameter(name="REAL", kind=ParamType.REAL, default=0.5, description=""),
            Parameter(name="PART", kind=ParamType.REAL, default=0.5, minimum=0.0, maximum=0.7, description=""),
            Parameter(name="CHOICE", kind=ParamType.INT, default=1, values=((1, "One"), (3, "Three")), description=""),
            Parameter(name="FIXED", kind=ParamType.INT, default=1, description="", read_only=True),
        ]
    )


@given(st.integers(INT32_MIN, INT32_MAX), st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_what_is_written_is_read(integer: int, real: float) -> None:
    parameters = parameters_of()
    parameters.set("INTEGER", integer)
    parameters.set("REAL", real)
    changed = {name: value for name, value in parameters.values.items() if value != parameters.default(name)}
    assert read(write(parameters), parameters_of()) == changed


def test_it_is_the_format_of_ground_stations() -> None:
    parameters = parameters_of()
    parameters.set("INTEGER", -3)
    parameters.set("PART", 0.7)
    *remarks, first, second = write(parameters, system_id=4).splitlines()
    assert all(line.startswith("#") for line in remarks)
    assert first == "4\t1\tINTEGER\t-3\t6"
    assert second == "4\t1\tPART\t0.699999988\t9"


def test_a_file_of_a_ground_station() -> None:
    text = (
        "# Onboard parameters for Vehicle 1\n#\n# Vehicle-Id Component-Id Name Value Type\n"
        "1\t1\tREAL\t0.150000005960464478\t9\n\n1\t1\tFIXED\t77\t6\n1\t154\tGIMBAL\tx\ty\n1\t1\tCHOICE\t3\t6\n"
    )
    assert read(text, parameters_of()) == {"REAL": float32(0.15), "CHOICE": 3}


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("1\t1\tREAL\t0.5", "line 2: expected 5 columns between tabs, not 4"),
        ("1 1 REAL 0.5 9", "line 2: expected 5 columns between tabs, not 1"),
        ("x\t1\tREAL\t0.5\t9", 'line 2: REAL: vehicle id "x": must be a number from 0 to 255'),
        ("1\t256\tREAL\t0.5\t9", 'line 2: REAL: component id "256": must be a number from 0 to 255'),
        ("1\t1\tNOTHING\t0.5\t9", "line 2: NOTHING: unknown parameter"),
        ("1\t1\tREAL\t0.5\t6", 'line 2: REAL: type must be 9, not "6"'),
        ("1\t1\tREAL\thalf\t9", "line 2: REAL: no number: 'half'"),
        ("1\t1\tREAL\tnan\t9", "line 2: REAL: nan is not from -3.40282347e+38 to 3.40282347e+38"),
        ("1\t1\tREAL\t1e39\t9", "line 2: REAL: 1e39 is not from -3.40282347e+38 to 3.40282347e+38"),
        ("1\t1\tPART\t0.8\t9", "line 2: PART: 0.8 is not from 0 to 0.699999988"),
        ("1\t1\tINTEGER\t1.0\t6", "line 2: INTEGER: no number: '1.0'"),
        ("1\t1\tINTEGER\t2147483648\t6", "line 2: INTEGER: 2147483648 is not from -2147483648 to 2147483647"),
        ("1\t1\tCHOICE\t2\t6", "line 2: CHOICE: 2 is not one of 1, 3"),
        ("1\t1\tREAL\t0.5\t9\n1\t1\tREAL\t0.6\t9", "line 3: REAL: given twice"),
    ],
)
def test_a_bad_file_is_one_clear_line(line: str, complaint: str) -> None:
    assert refusal_of(read, f"# a remark\n{line}\n", parameters_of()) == complaint


@given(st.text())
def test_any_text_is_read_or_refused(text: str) -> None:
    with suppress(ParameterFileError):
        assert read(text, parameters_of()) == {}
