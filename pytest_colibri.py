"""The pytest plugin under a name of its own: pytest finds it here, wherever it runs.

A project that is tested may have a package `tools` of its own in front of this one's. Its tests then run as ever; only
one that asks for the fixtures is told why there are none.
"""

from importlib.util import find_spec

import pytest

if find_spec("tools") and find_spec("tools.scenarios"):
    from tools.scenarios.plugin import *  # noqa: F403
else:

    @pytest.fixture
    def sitl() -> None:
        """Say why there is no vehicle."""
        pytest.fail("fixture sitl needs colibri's package `tools`, and another one of that name is in front of it")

    sitl_fleet = sitl
