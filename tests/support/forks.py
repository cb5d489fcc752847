"""Run commands of `colibri` in forks of the test process, whose modules are already loaded."""

import os
import signal
import subprocess
import sys
from importlib import import_module
from multiprocessing.context import ForkProcess
from types import SimpleNamespace
from typing import IO, Any, NoReturn

from colibri.common.process.lifecycle import handle_endings
from colibri.common.process.output import finish_outputs
from colibri.flights.launcher import Child, ProcessSpec


class Forked(ForkProcess):
    """`python -m MODULE WORDS...`, used as `subprocess.Popen` is."""

    def __init__(self, command: list[str], stdout: IO[bytes], stderr: IO[bytes], **_: Any) -> None:
        module, *words = command[command.index("-m") + 1 :]
        super().__init__(target=_run, args=(module, words, stdout.fileno(), stderr.fileno()))
        self.start()

    def poll(self) -> int | None:
        return self.exitcode

    def wait(self, timeout: float | None = None) -> int:
        self.join(timeout)
        if self.exitcode is None:
            raise subprocess.TimeoutExpired(self.name, timeout or 0.0)
        return self.exitcode

    def send_signal(self, number: int) -> None:
        if self.is_alive() and self.pid is not None:
            os.kill(self.pid, number)


def forked_child(spec: ProcessSpec) -> Child:
    return Child(spec, fork=True)


FORKS = SimpleNamespace(Popen=Forked, DEVNULL=subprocess.DEVNULL, TimeoutExpired=subprocess.TimeoutExpired)
"""In place of the module `subprocess`."""


def _run(module: str, words: list[str], stdout: int, stderr: int) -> NoReturn:
    handle_endings(signal.SIG_DFL)
    os.setpgid(0, 0)
    for to, of in ((0, os.open(os.devnull, os.O_RDONLY)), (1, stdout), (2, stderr)):
        os.dup2(of, to)
    sys.stdout, sys.stderr = (os.fdopen(it, "w", buffering=1, closefd=False) for it in (1, 2))
    try:
        sys.exit(import_module("colibri.cli.main" if module == "colibri" else f"{module}.__main__").main(words))
    finally:
        finish_outputs()
