"""`colibri verify`."""

from argparse import Namespace
from pathlib import Path

from colibri.cli.shared.options import add_out
from colibri.common.process.arguments import ArgumentParser, positive

GOLDEN_HASHES = Path("tests/golden/hashes.json")


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    parser.add_argument("--link", default="udp", choices=("udp", "memory"), help="of the flights (default %(default)s)")
    add("--duration", "S", "simulated time of each flight (default 20; golden: its own)", type=positive)
    add(
        "--golden",
        "FILE",
        "fly the golden flights instead, once each, and compare their hashes with those in FILE "
        f"(default {GOLDEN_HASHES})",
        type=Path,
        nargs="?",
        const=GOLDEN_HASHES,
    )
    parser.flag("--renew", "with --golden: write the hashes to FILE, and show which have changed")
    parser.several("--only", "NAME", "with --golden: only this flight")
    add_out(parser, "out/verify", "the logs")


def run(args: Namespace) -> int:
    if args.golden is not None:
        from colibri.verification.golden import verify_golden

        return verify_golden(args)
    from colibri.verification.verify import verify

    return verify(args)
