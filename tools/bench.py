"""`make bench`: `colibri bench` beside RotorPy, if installed."""

import os
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from time import perf_counter
from warnings import catch_warnings, simplefilter

from colibri.bench.run import bench
from colibri.bench.speed import PeerSimulator
from colibri.cli.options import bench as add_options
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import EXIT_FAILED, fail, fail_interrupted, use_one_thread


def main(argv: Sequence[str] | None = None) -> int:
    parser = ArgumentParser(prog="python -m tools.bench", description="How fast it flies, beside RotorPy.")
    add_options(parser)
    args = parser.parse_args(argv)
    use_one_thread()
    peer = PeerSimulator("rotorpy", real_time_factor) if find_spec("rotorpy") else None
    if peer is None and "flights" in (args.only or ["flights"]):
        sys.stderr.write(f"colibri: {MISSING}\n")
    try:
        return bench(args, peer)
    except KeyboardInterrupt as ended:
        fail_interrupted(ended)


MISSING = "RotorPy is not installed: pip install 'colibri-sitl[bench]' brings it; going on without"


def real_time_factor(frames_hz: int, duration_s: float) -> float:
    """Fly a lemniscate; return simulated over wall-clock time, without loading."""
    environment = _environment(frames_hz)
    with catch_warnings():
        simplefilter("ignore")
        began_s = perf_counter()
        result = environment.run(t_final=duration_s, terminate=False, plot=False)
        wall_time_s = perf_counter() - began_s
    flown_s = float(result["time"][-1])
    if flown_s < 0.99 * duration_s:
        fail(f"RotorPy ended its flight after {flown_s:.1f} s: {result['exit'].value}", EXIT_FAILED)
    return flown_s / wall_time_s


def _environment(frames_hz: int):  # type: ignore[no-untyped-def]
    if "matplotlib" not in sys.modules:
        os.environ.setdefault("MPLBACKEND", "Agg")
    with catch_warnings():
        simplefilter("ignore")
        from rotorpy.controllers.quadrotor_control import SE3Control
        from rotorpy.environments import Environment
        from rotorpy.trajectories.lissajous_traj import TwoDLissajous
        from rotorpy.vehicles.hummingbird_params import quad_params
        from rotorpy.vehicles.multirotor import Multirotor

        return Environment(
            vehicle=Multirotor(quad_params),
            controller=SE3Control(quad_params),
            trajectory=TwoDLissajous(A=2.0, B=1.0, a=1.0, b=2.0),
            sim_rate=frames_hz,
        )


if __name__ == "__main__":
    sys.exit(main())
