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
    add = parser.value
    add("profile", "PROFILE", "control profile name or .toml")
    add("--controller", "NAME", "control law that the profile has numbers for (default: its own)")
    add("--vehicle", "NAME", "vehicle name or .toml (default: the profile's)")
    add("--moment", "NM", "moment that disturbs, N m", type=positive, default=0.01)
    add("--charge", "PART", "part of the battery's charge that may be taken", type=part, default=0.5)
    least = "refuse a law without Lyapunov function over this part of the profile's ranges"
    add("--least", "PART", least, type=part, default=0.5)
    add("--flights", "N", "flights from the set's border", type=some, default=1000)
    add("--seed", "N", "seed of the flights (default %(default)s)", type=natural, default=0)
    add_out(parser, "out/certify", "certificate, table and figure")


def run(args: Namespace) -> int:
    from colibri.certification.report import certify_profile
    from colibri.flights.folder import occupied

    with occupied(args.out):
        return certify_profile(args)
