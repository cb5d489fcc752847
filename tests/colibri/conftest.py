"""Commands that are run, and that are refused."""

import pytest

from tests.support.commands import Ran, Refused, Said, exit_code


@pytest.fixture
def ran(capfd: pytest.CaptureFixture[str]) -> Ran:
    def run(*words: object, code: int = 0) -> Said:
        capfd.readouterr()
        assert (exit_code([*map(str, words)]) or 0) == code
        return Said(*capfd.readouterr())

    return run


@pytest.fixture
def refused(ran: Ran) -> Refused:
    def run(*words: object, code: int = 2) -> str:
        said = ran(*words, code=code)
        (line,) = said.err.splitlines()
        assert said.out == ""
        assert line.startswith("colibri: error: ")
        return line.removeprefix("colibri: error: ")

    return run
