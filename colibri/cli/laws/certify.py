"""`colibri certify`."""

from argparse import ArgumentTypeError, Namespace

from colibri.cli.shared.options import add_out
from colibri.common.process.arguments import ArgumentParser, natural, positive


def part(text: str) -> float:
    value = positive(text)
    if value > 1.0:
        raise ArgumentTypeError(f"must be a part of 1, not {text}")
    return value


def some(text: str) -> int:
    value = natural(text)
    if value == 0:
        raise ArgumentTypeError("must be at least 1")
    return value


def add_options(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("profile", metavar="PROFILE", help="control profile name or .toml")
    add("--controller", metavar="NAME", help="control law that the profile has numbers for (default: its own)")
    add("--vehicle", metavar="NAME", help="vehicle name or .toml (default: the profile's)")
    add("--moment", type=positive, default=0.01, metavar="NM", help="moment that disturbs, N m (default %(default)s)")
    add(
        "--charge",
        type=part,
        default=0.5,
        metavar="PART",
        help="part of the battery's charge that may be taken (default %(default)s)",
    )
    add(
        "--least",
        type=part,
        default=0.5,
        metavar="PART",
        help="refuse a law without Lyapunov function over this part of the profile's ranges (default %(default)s)",
    )
    add("--flights", type=some, default=1000, metavar="N", help="flights from the set's border (default %(default)s)")
    add("--seed", type=natural, default=0, metavar="N", help="seed of the flights (default %(default)s)")
    add_out(add, "out/certify", "certificate, table and figure")


def run(args: Namespace) -> int:
    from colibri.certification.report import certify_profile
    from colibri.flights.folder import occupied

    with occupied(args.out):
        return certify_profile(args)
