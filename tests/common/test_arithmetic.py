"""What the bits of a flight depend on: IEEE 754's operations, and nothing that a library chooses by the CPU."""

import ast
from pathlib import Path

import pytest

PACKAGES = Path(__file__).parents[2] / "colibri"
FLOWN = [path for package in ("autopilot", "common", "mavlink", "plant") for path in (PACKAGES / package).rglob("*.py")]

_TRANSCENDENTAL = (
    "acos acosh asin asinh atan atan2 atanh cbrt cos cosh exp exp2 expm1 log log10 log1p log2 pow sin sinh"
)
OF_LIBM = {*_TRANSCENDENTAL.split(), "tan", "tanh"}
"""`colibri.common.elementary` has those that are needed; `math.sqrt`, `hypot` and `dist` are exact, or Python's own."""
OF_NUMPY = {
    *(name.replace("a", "arc", 1) if name.startswith("a") else name for name in OF_LIBM),
    *("dot", "einsum", "float_power", "hypot", "inner", "linalg", "logaddexp", "matmul", "power", "tensordot", "vdot"),
}
OF_SCIPY = {"autopilot/control/qp.py": {"scipy.optimize", "scipy.sparse"}}
"""To say why a QP has no solution, and to hand it to the sparse solvers: no number of a flight."""
CHECKS = {path: {"linalg"} for path in ("plant/physics/contact.py", "plant/vehicle/description.py")}
"""A vehicle file is refused by its rank or its fastest rate: no number of a flight."""


def used(path: Path) -> set[str]:
    """Return what a file uses of what chooses its code by the CPU: BLAS, LAPACK, libm, NumPy's SIMD, SciPy."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        match node:
            case ast.BinOp(op=ast.MatMult()):
                found.add("@")
            case ast.Call(func=ast.Attribute(attr="dot")):
                found.add(".dot")
            case ast.ImportFrom(module="math", names=names):
                found |= {it.name for it in names} & OF_LIBM
            case ast.ImportFrom(module="numpy", names=names):
                found |= {it.name for it in names} & OF_NUMPY
            case ast.ImportFrom(module=str(module)) if module.startswith("scipy"):
                found.add(module)
            case ast.Attribute(value=ast.Name(id="math"), attr=name) if name in OF_LIBM:
                found.add(name)
            case ast.Attribute(value=ast.Name(id="np"), attr=name) if name in OF_NUMPY:
                found.add(name)
    return found


@pytest.mark.parametrize("path", FLOWN, ids=lambda path: path.relative_to(PACKAGES).as_posix())
def test_no_bit_of_a_flight_is_left_to_a_library(path: Path) -> None:
    name = path.relative_to(PACKAGES).as_posix()
    assert used(path) <= OF_SCIPY.get(name, set()) | CHECKS.get(name, set())


def test_what_is_left_to_one_is_found(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text("import numpy as np\nfrom math import sin\nA @ A\nnp.linalg.inv(A)\nA.dot(A)\n")
    assert used(tmp_path / "law.py") == {"sin", "@", "linalg", ".dot"}
