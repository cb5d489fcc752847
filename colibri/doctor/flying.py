"""Fly as a user would, and locate the cache of machine code."""

import os
import platform
from pathlib import Path

from colibri.common.errors import Error
from colibri.doctor.finding import Finding, Severity

_TRACK, _DURATION_S = "hover", 2.0
_CPU_INFO = Path("/proc/cpuinfo")


def machine_code() -> Finding:
    from colibri.common.machine_code.on_disk import MachineCode
    from colibri.common.rotations import rotation_matrix

    folder = MachineCode(rotation_matrix).cache_path
    if folder is None:
        advice = "name a folder: NUMBA_CACHE_DIR=FOLDER"
        return Finding("machine code", Severity.NOTE, "cannot be cached: each start compiles again", advice)
    if not os.access(folder, os.W_OK):
        advice = "make it so, or name another: NUMBA_CACHE_DIR=FOLDER"
        return Finding("machine code", Severity.NOTE, f"{folder} cannot be written to", advice)
    return Finding("machine code", Severity.FINE, f"kept in {folder}")


def flight() -> Finding:
    """Measure the speed of two processes over loopback, without compilation."""
    from colibri.experiments.flight import fly

    try:
        flown = fly(_TRACK, link="udp", duration=_DURATION_S)
    except Error as error:
        return Finding("flight", Severity.FAILED, str(error), "for details: colibri fly hover")
    times = flown.report["real_time_factor"]
    return Finding("flight", Severity.FINE, f"{times:.0f} times real time, on {os.cpu_count()} cores: {processor()}")


def processor() -> str:
    if _CPU_INFO.exists():
        for line in _CPU_INFO.read_text(encoding="utf-8", errors="replace").splitlines():
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                return value.strip()
    return platform.processor() or platform.machine()
