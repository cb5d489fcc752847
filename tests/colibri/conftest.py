"""Commands that are refused."""

import pytest

from tests.support.commands import Refused, exit_code


@pytest.fixture
def refused(capfd: pytest.CaptureFixture[str]) -> Refused:
    def run(*words: object, code: int = 2) -> str:
        capfd.readouterr()
        assert exit_code([*map(str, words)]) == code
        said = capfd.readouterr()
        (line,) = said.err.splitlines()
        assert said.out == ""
        assert line.startswith("colibri: error: ")
        return line.removeprefix("colibri: error: ")

    return run
