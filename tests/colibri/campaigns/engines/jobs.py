"""Jobs for engines, as workers import them."""

import os
import signal
import sys
from contextlib import closing
from pathlib import Path
from time import sleep

import numpy as np

from colibri.campaigns.engines import Pool

KILLS = -1


loaded = ""


def what_is_loaded(_common: None, _job: int) -> str:
    return loaded


def doubled(common: int, job: int) -> int:
    """Return a job times what is common; some kill whoever does them."""
    if job == KILLS:
        os.kill(os.getpid(), signal.SIGKILL)
    return common * job


def drawn(_common: None, _job: int) -> float:
    return float(np.random.random())  # noqa: NPY002


def named(folder: str, job: int) -> None:
    """Leave a file with the number of the process that does this, and take long."""
    (Path(folder) / str(os.getpid())).touch()
    sleep(600.0)
    del job


if __name__ == "__main__":
    with closing(Pool(2).each(named, sys.argv[1], range(4))) as results:
        list(results)
