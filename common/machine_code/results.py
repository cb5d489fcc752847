"""Compilation results on disk, in a form that loads without numba's front end.

By default, numba imports its compiler and SciPy before it loads the first kernel, and parses each kernel's intermediate
code, which only the compilation of a caller needs.
"""

from functools import cache
from typing import Any, NamedTuple

from llvmlite.binding import add_symbol, address_of_symbol, parse_bitcode
from numba.core.caching import CompileResultCacheImpl
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import compile_result
from numba.core.environment import Environment
from numba.core.runtime import _nrt_python  # type: ignore[attr-defined]

_EMPTY = Environment({})


class _Kept(NamedTuple):
    """A kernel that can be loaded without numba's front end.

    Attributes:
        name: Of its code library.
        intermediate_code: For inlining into callers.
        defined: Names of its functions and globals.
        needed: Names of external symbols: of Python, the C library, numba's runtime.
        environments: Names of further environments it uses; they are empty.
        description: Of arguments and result.
        environment: The Python objects that it uses.
        signature: The types.
    """

    name: str
    machine_code: bytes
    intermediate_code: bytes
    defined: list[str]
    needed: list[str]
    environments: list[str]
    description: Any
    environment: Any
    signature: Any


class Results(CompileResultCacheImpl):
    """Writer and reader of compilation results for numba.

    Attributes:
        version: Of all inputs of a result. It is stored with each result: two versions that write at once may leave the
            index of one and the result of the other.
    """

    version: tuple[str, ...] = ()

    def reduce(self, cres: Any) -> Any:
        return self.version, self._kept(cres)

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        if payload[0] != self.version:
            return None
        kept = payload[1]
        if isinstance(kept, _Kept):
            return _loaded(target_context, kept)
        target_context.refresh()
        return super().rebuild(target_context, kept)

    def _kept(self, cres: Any) -> Any:
        """Return a `_Kept` if it holds all of the result, otherwise numba's own reduction."""
        whole = super().reduce(cres)
        (name, _, (machine_code, intermediate)), description, environment, signature, *others = whole
        object_mode, lifted, _, reload_init, environments = others
        module = parse_bitcode(intermediate)
        symbols = [it for it in (*module.functions, *module.global_variables) if not it.name.startswith("llvm.")]
        needed = [it.name for it in symbols if it.is_declaration]
        text = str(module)
        used = [it for it in environments if it is not environment and text.count(it.env_name) > 1]
        if object_mode or lifted or reload_init or any(it.consts for it in used):
            return whole
        defined = [it.name for it in symbols if not it.is_declaration]
        names = [it.env_name for it in used]
        code = (machine_code, intermediate, defined, needed, names)
        return _Kept(name, *code, description, environment, signature)


def _loaded(target_context: Any, kept: _Kept) -> Any:
    _name_runtime()
    if not all(map(_is_loaded, kept.needed)):
        target_context.refresh()
    codegen = target_context.codegen()
    library = _Library(codegen, kept)
    entry_point = target_context.get_executable(library, kept.description, kept.environment)
    for name in kept.environments:
        codegen.set_env(name, _EMPTY)
    return compile_result(
        target_context=target_context,
        typing_context=target_context.typing_context,
        entry_point=entry_point,
        signature=kept.signature,
        objectmode=False,
        fndesc=kept.description,
        library=library,
        environment=kept.environment,
    )


class _Library(JITCodeLibrary):
    """A kernel's code from disk; intermediate code is parsed when a caller is compiled."""

    def __init__(self, codegen: Any, kept: _Kept) -> None:
        super().__init__(codegen, kept.name)
        self._intermediate_code = kept.intermediate_code
        self.enable_object_caching()
        self._set_compiled_object(kept.machine_code)
        self._finalize_final_module()
        codegen._engine._defined_symbols.update(kept.defined)  # noqa: SLF001

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = parse_bitcode(self._intermediate_code)
        return self._shared_module


@cache
def _name_runtime() -> None:
    """Register numba's runtime with LLVM; numba's own registration also compiles the runtime."""
    for name, address in _nrt_python.c_helpers.items():
        add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


@cache
def _is_loaded(name: str) -> bool:
    """Return whether a symbol exists in this process: LLVM aborts on a missing one."""
    return address_of_symbol(name) is not None
