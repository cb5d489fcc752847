"""Where processes leave what they say."""

from pathlib import Path

import pytest


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    folder = tmp_path / "logs"
    folder.mkdir()
    return folder
