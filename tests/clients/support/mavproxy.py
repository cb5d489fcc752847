"""MAVProxy by its own command line: lines typed into it, and what it prints."""

import os
import re
import shutil
from pathlib import Path
from typing import Self

from tests.clients.support.client import Client
from tools.harness.processes import wait_for

ENVIRONMENT = Path(os.environ.get("COLIBRI_CLIENTS", ".venv-clients"))
"""The environment that the clients are installed in."""
GIVE_UP_AFTER_S = 60.0


def program() -> Path:
    found = shutil.which("mavproxy.py", path=str((ENVIRONMENT / "bin").absolute()))
    assert found, f"no MAVProxy in {ENVIRONMENT}: `make test-clients` installs it, COLIBRI_CLIENTS names another place"
    return Path(found)


class MavProxy:
    """A running MAVProxy that has found its vehicle and fetched its parameters."""

    def __init__(self, folder: Path, connection: str) -> None:
        self.folder = folder
        # It reads its settings from the home folder, and `python` stands beside it
        command = ["env", f"HOME={folder}", str(program()), f"--master={connection}", f"--state-basedir={folder}"]
        self._client = Client(command, folder)
        self._read = 0

    def __enter__(self) -> Self:
        self.expect(r"Received \d+ parameters")
        return self

    def __exit__(self, *_: object) -> None:
        self._client.end()

    def type(self, line: str, pattern: str) -> re.Match[str]:
        self._read = len(self._client.printed)
        stdin = self._client.process.stdin
        assert stdin is not None, "it reads what is typed"
        stdin.write(line.encode() + b"\n")
        stdin.flush()
        return self.expect(pattern)

    def expect(self, pattern: str) -> re.Match[str]:
        """Wait for a regular expression in what it prints, behind what was read last; return the match."""
        found: list[re.Match[str]] = []

        def look() -> bool:
            match = re.compile(pattern, re.MULTILINE).search(self._client.printed, self._read)
            found.extend([match] if match else [])
            return bool(match) or self._client.process.poll() is not None

        try:
            wait_for(look, f"{pattern} from MAVProxy", GIVE_UP_AFTER_S / 3600.0)
        except AssertionError as error:
            raise AssertionError(f"{error}; it printed:\n{self._client.printed[self._read :]}") from None
        assert found, f"MAVProxy ended:\n{self._client.printed[-2000:]}"
        self._read = found[-1].end()
        return found[-1]
