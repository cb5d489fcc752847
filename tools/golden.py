"""`make golden`: golden flights on other CPUs, simulated by forced choices, and Pythons; 1 if any hash differs."""

import argparse
import json
import os
import platform
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import NamedTuple

import numpy as np

from colibri.common.process.arguments import chosen
from colibri.common.process.lifecycle import EXIT_FAILED, fail_interrupted
from colibri.verification.verify import FOUND

_MADE_FROM = ("requirements.lock", "pyproject.toml")  # an environment older than these is stale


def environments(root: Path) -> dict[str, Path]:
    """Return .venv-3.N by version."""
    return {ready.parent.name.removeprefix(".venv-"): ready.parent for ready in sorted(root.glob(".venv-3.*/.ready"))}


def is_stale(root: Path, environment: Path) -> bool:
    made = (environment / ".ready").stat().st_mtime
    return made <= max((root / name).stat().st_mtime for name in _MADE_FROM)


ROOT = Path(__file__).parents[1]
HASHES = ROOT / "tests" / "golden" / "hashes.json"
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
NO_AVX2_NOR_FMA = "glibc.cpu.hwcaps=-AVX2_Usable,-AVX2,-FMA_Usable,-FMA,-FMA4_Usable,-FMA4,-AVX512F_Usable,-AVX512F"
"""Names that end in _Usable are those of glibc before 2.33."""
_AVX2 = ("avx2", "fma")
_AVX512 = (*_AVX2, "avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl")


class VariationError(Exception):
    """The flights of a variation did not end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variation:
    name: str
    environment: Mapping[str, str] = field(default_factory=dict)  # additional variables of its processes
    needs: Sequence[str] = ()  # flags of the CPU, as in /proc/cpuinfo
    lacks: str = ""  # why it cannot be flown here on any CPU
    python: Path = Path(sys.executable)

    def obstacle(self) -> str:
        """Return why it cannot be flown here, if so."""
        missing = [flag for flag in self.needs if flag not in cpu_flags()]
        return self.lacks or (f"this CPU has no {', '.join(missing)}" if missing else "")


class GoldenHashes(NamedTuple):
    """Hash of each flight, empty if it did not end, and the duration."""

    hashes: dict[str, str]
    took_s: float

    def differing(self) -> dict[str, tuple[str, str]]:
        """Return expected and found hashes that differ."""
        golden: dict[str, str] = json.loads(HASHES.read_text(encoding="utf-8"))
        return {name: (golden[name], found) for name, found in self.hashes.items() if found != golden[name]}


def variations() -> list[Variation]:
    return [
        Variation(name="as-it-is"),
        *(
            Variation(name=f"openblas-{core.lower()}", environment={"OPENBLAS_CORETYPE": core}, needs=needs)
            for core, needs in _OPENBLAS_CORES.items()
        ),
        _numpy_without_simd(),
        *(_numba(cpu, needs) for cpu, needs in _NUMBA_CPUS.items()),
        Variation(
            name="glibc-without-avx2-and-fma",
            environment={"GLIBC_TUNABLES": NO_AVX2_NOR_FMA},
            needs=_AVX2,
            lacks="" if platform.libc_ver()[0] == "glibc" else "the C library is not glibc",
        ),
        Variation(name="two-threads", environment=dict.fromkeys(ONE_THREAD, "2")),
        *(
            Variation(
                name=f"python-{version}",
                python=folder / "bin" / "python",
                lacks=_STALE.format(version) * is_stale(ROOT, folder),
            )
            for version, folder in environments(ROOT).items()
        ),
    ]


_OPENBLAS_CORES = {"Nehalem": ("sse4_2",), "Haswell": _AVX2, "SkylakeX": _AVX512, "Zen": _AVX2}
_STALE = ".venv-{} is older than the lock or the package: make verify-pythons"
_NUMBA_CPUS = {"generic": (), "haswell": _AVX2, "skylake-avx512": _AVX512}


def _numpy_without_simd() -> Variation:
    found: list[str] = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    return Variation(
        name="numpy-without-simd",
        environment={"NPY_DISABLE_CPU_FEATURES": " ".join(found)},
        lacks="" if found else "this numpy chooses nothing by the CPU",
    )


def _numba(cpu: str, needs: Sequence[str]) -> Variation:
    """Compile kernels for a CPU with its own features."""
    kept = Path(sys.prefix) / "golden-kernels" / cpu
    environment = {"NUMBA_CPU_NAME": cpu, "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(kept)}
    lacks = "" if platform.machine() in ("x86_64", "AMD64") else "not an x86 CPU"
    return Variation(name=f"numba-{cpu}", environment=environment, needs=needs, lacks=lacks)


@cache
def cpu_flags() -> frozenset[str]:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return frozenset()
    return frozenset(flag for line in lines if line.startswith("flags") for flag in line.partition(":")[2].split())


def fly(variation: Variation, out: Path, link: str = "memory", only: Sequence[str] = ()) -> GoldenHashes:
    command = [str(variation.python), "-m", "colibri", "verify", "--golden", str(HASHES), "--link", link]
    command += ["--out", str(out), "--quiet", *(f"--only={name}" for name in only)]
    began_s = perf_counter()
    done = subprocess.run(command, cwd=ROOT, env=_environment(variation), capture_output=True, text=True, check=False)
    took_s = perf_counter() - began_s
    if not (out / FOUND).exists():
        words = done.stderr.strip().splitlines()
        raise VariationError(f"{variation.name}: exit code {done.returncode}: {words[-1] if words else 'no word'}")
    outcomes = json.loads((out / FOUND).read_text(encoding="utf-8"))
    flown = GoldenHashes({name: outcome["sha256"] for name, outcome in outcomes.items()}, took_s)
    assert done.returncode == (1 if flown.differing() else 0), done.stderr
    return flown


def _environment(variation: Variation) -> dict[str, str]:
    varied = {"OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "GLIBC_TUNABLES", *ONE_THREAD}
    varied |= {"NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"}
    usual = {name: value for name, value in os.environ.items() if name not in varied}
    return {**usual, **ONE_THREAD, **variation.environment}


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.golden", description=__doc__)
    parser.add_argument("--link", default="memory", choices=("memory", "udp"), help="(default %(default)s)")
    parser.add_argument("--only", action="append", default=[], metavar="FLIGHT", help="only this; may be repeated")
    parser.add_argument("--variation", action="append", default=[], metavar="NAME", help="only this; may be repeated")
    parser.add_argument("--pythons", action="store_true", help="only those of other Pythons, in .venv-3.N")
    args = parser.parse_args(argv)
    known = {variation.name: variation for variation in variations()}
    wanted = chosen("variation", args.variation, known, "--variation: ")
    if args.pythons:
        wanted = [each for each in wanted if each.name.startswith("python-")]
    try:
        return _fly_all(wanted, args.link, args.only)
    except KeyboardInterrupt as ended:
        fail_interrupted(ended)


def _fly_all(wanted: Sequence[Variation], link: str, only: Sequence[str]) -> int:
    failed = False
    for variation in wanted:
        obstacle = variation.obstacle()
        if obstacle:
            print(f"{variation.name}: not flown: {obstacle}", flush=True)
            continue
        with TemporaryDirectory(prefix="golden-") as out:
            try:
                done = fly(variation, Path(out), link, only)
            except VariationError as error:
                print(f"FAILED: {error}", flush=True)
                failed = True
                continue
        differing = done.differing()
        failed |= bool(differing)
        print(f"{variation.name}: {len(done.hashes)} flights in {done.took_s:.0f} s, {len(differing)} differ")
        for flight, (expected, found) in differing.items():
            print(f"  {flight}: expected {expected[:16]}, found {found[:16] or 'none: it did not end'}")
        sys.stdout.flush()
    return EXIT_FAILED if failed else 0


if __name__ == "__main__":
    sys.exit(main())
