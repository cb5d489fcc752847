"""Parameters: all of them, one whole and one real number there and back, and what is refused."""

import sys

from mavsdk.plugins.param import Param, ParamResult

from tests.clients.mavsdk_scripts.connection import connected, refused

WHOLE, REAL = "SYS_FAILURE_EN", "MIS_TAKEOFF_ALT"


def main(url: str) -> None:
    with connected(url) as vehicle:
        param = Param(vehicle)
        everything = param.get_all_params()
        assert WHOLE in [each.name for each in everything.int_params]
        assert REAL in [each.name for each in everything.float_params]
        for value in (1, 0):
            param.set_param_int(WHOLE, value)
            assert param.get_param_int(WHOLE) == value
        for real in (7.25, 3.5):
            param.set_param_float(REAL, real)
            assert param.get_param_float(REAL) == real
        refused(lambda: param.get_param_float("NO_SUCH"), ParamResult.DOES_NOT_EXIST)
        refused(lambda: param.get_param_int(REAL), ParamResult.WRONG_TYPE)


if __name__ == "__main__":
    main(sys.argv[1])
