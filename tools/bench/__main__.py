"""`make bench`: `colibri bench` beside RotorPy, if installed."""

import sys
from collections.abc import Sequence

from colibri.bench.run import bench
from colibri.bench.speed import PeerSimulator
from colibri.cli.options import bench as add_options
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail_interrupted, use_one_thread
from tools.bench import rotorpy_peer


def main(argv: Sequence[str] | None = None) -> int:
    parser = ArgumentParser(prog="python -m tools.bench", description="How fast it flies, beside RotorPy.")
    add_options(parser)
    args = parser.parse_args(argv)
    use_one_thread()
    peer = PeerSimulator("rotorpy", rotorpy_peer.real_time_factor) if rotorpy_peer.installed() else None
    if peer is None and "flights" in (args.only or ["flights"]):
        sys.stderr.write(f"colibri: {rotorpy_peer.MISSING}\n")
    try:
        return bench(args, peer)
    except KeyboardInterrupt as ended:
        fail_interrupted(ended)


if __name__ == "__main__":
    sys.exit(main())
