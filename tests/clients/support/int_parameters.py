"""MAVSDK 4 sets an integer parameter to each value of the command line and reads it back: prints what it reads.

In a process of its own: `python -m tests.clients.support.int_parameters URL NAME VALUE...`.
"""

import json
import sys

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.param import Param

_FOUND_WITHIN_S = 30.0


def main(url: str, name: str, *values: str) -> None:
    """Print the values as a JSON list."""
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    mavsdk.add_any_connection(url)
    param = Param(mavsdk.first_autopilot(_FOUND_WITHIN_S))
    read = []
    for value in values:
        param.set_param_int(name, int(value))
        read.append(param.get_param_int(name))
    sys.stdout.write(json.dumps(read) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
