import subprocess
import sys
from pathlib import Path

import pytest

from colibri.common.process.folder_lock import FolderInUseError, FolderLock

HOLDER = """
import sys
from pathlib import Path
from colibri.common.process.folder_lock import FolderLock

lock = FolderLock(Path(sys.argv[1]), "--out")
print("held", flush=True)
sys.stdin.read()
"""


def test_a_second_flight_in_a_folder_is_refused(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLDER, str(tmp_path / "out")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(FolderInUseError, match=r"^--out .*out is in use by another flight: end that or name .*$"):
            FolderLock(tmp_path / "out", "--out")
        holder.kill()
    with FolderLock(tmp_path / "out", "--out"):
        pass
    assert list((tmp_path / "out").iterdir()) == []
