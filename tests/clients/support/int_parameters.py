"""MAVSDK 4 sets an integer parameter to each value of the command line and reads it back: prints what it reads.

In a process of its own: `python -m tests.clients.support.int_parameters URL NAME VALUE...`.
"""

import json
import sys

from mavsdk.plugins.param import Param

from tests.clients.mavsdk_scripts.connection import connected

if __name__ == "__main__":
    _, url, name, *values = sys.argv
    read = []
    with connected(url) as vehicle:
        param = Param(vehicle)
        for value in values:
            param.set_param_int(name, int(value))
            read.append(param.get_param_int(name))
    sys.stdout.write(json.dumps(read) + "\n")
