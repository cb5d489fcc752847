"""Flies a script of this package: `python -m tests.clients.mavsdk_scripts MODULE.FUNCTION URL`."""

import sys
from importlib import import_module

from tests.clients.mavsdk_scripts.connection import connected

if __name__ == "__main__":
    module, _, name = sys.argv[1].partition(".")
    script = getattr(import_module(f"tests.clients.mavsdk_scripts.{module}"), name)
    with connected(sys.argv[2]) as vehicle:
        script(vehicle)
