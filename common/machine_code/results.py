"""Compilation results on disk, loaded without numba's front end, compiler and SciPy."""

from collections.abc import Callable
from functools import cache
from glob import escape
from pathlib import Path
from typing import Any, NamedTuple

from llvmlite.binding import add_symbol, address_of_symbol, parse_bitcode
from numba.core.caching import CompileResultCacheImpl, _CacheLocator
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import compile_result
from numba.core.environment import Environment
from numba.core.runtime import _nrt_python  # type: ignore[attr-defined]

_EMPTY = Environment({})


class _Kept(NamedTuple):
    """A kernel that can be loaded without numba's front end."""

    name: str
    machine_code: bytes
    intermediate_code: bytes  # for inlining into callers
    defined: list[str]  # its functions and globals
    needed: list[str]  # external symbols
    environments: list[str]  # further ones that it uses, all empty
    description: Any  # of arguments and result
    environment: Any  # the Python objects that it uses
    signature: Any


class Results(CompileResultCacheImpl, _CacheLocator):
    """Writer and reader of compilation results for numba."""

    def __init__(self, function: Callable[..., Any], folder: Path, key: str) -> None:
        self._py_file, self._lineno = function.__code__.co_filename, function.__code__.co_firstlineno
        self._locator, self._folder, self._key = self, folder, key
        self._prefix = f"{function.__module__}.{function.__qualname__}-".replace("<", "").replace(">", "")
        self._filename_base = self._prefix + key

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return self._key

    get_disambiguator = get_source_stamp

    def drop_unused(self, for_s: float) -> None:
        """Delete files of this kernel's other versions that were not read for this time."""
        files = {file: file.stat() for file in self._folder.glob(f"{escape(self._prefix)}*")}
        before_s = max((it.st_mtime for it in files.values()), default=0.0) - for_s
        for file, it in files.items():
            if max(it.st_atime, it.st_mtime) < before_s:
                file.unlink(missing_ok=True)

    def reduce(self, cres: Any) -> Any:
        return self._kept(cres)

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        if isinstance(payload, _Kept):
            return _loaded(target_context, payload)
        target_context.refresh()
        return super().rebuild(target_context, payload)

    def _kept(self, cres: Any) -> Any:
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
    for name, address in _nrt_python.c_helpers.items():
        add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


@cache
def _is_loaded(name: str) -> bool:
    return address_of_symbol(name) is not None
