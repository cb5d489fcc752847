"""`colibri fly`: its options, and its call."""

from argparse import Namespace

from colibri.analysis.limits import limit
from colibri.cli.shared.beside import add_view, viewed
from colibri.cli.shared.options import add_out, add_signing
from colibri.common.process.arguments import ArgumentParser
from colibri.common.process.lifecycle import fail, loading
from colibri.experiments.options import add_plan_options


def add_options(parser: ArgumentParser) -> None:
    """Add the options of `colibri fly`."""
    add_plan_options(parser, link="udp")
    add = parser.add_argument
    add(
        "--gcs",
        action="append",
        default=[],
        metavar="URL",
        help="a ground station that may watch and command: udpout:, udpin:, tcp: or tcpin:HOST:PORT, or "
        "serial:DEVICE:BAUD; may be repeated",
    )
    add_view(add)
    add_signing(add)
    add_out(add, "out", "logs and figures")
    add(
        "--fail-above",
        type=limit,
        action="append",
        default=[],
        metavar="[KEY=]VALUE",
        help="exit with 1 if a number of report.json is larger: of rmse_after_20s_m (m), or another by its KEY, "
        "ground_contact_s=0 say; may be repeated",
    )
    add("--no-figures", action="store_true", help="draw no PNG figures")
    add("--no-ulog", action="store_true", help="write no flight.ulg")


def run(args: Namespace) -> int:
    """Fly as the command line says; return the exit code."""
    with loading():
        from colibri.cli.shared.fly_and_report import fly

    if args.view and args.link != "udp":
        fail(f"--view needs --link udp: over {args.link} there is no autopilot to connect to")
    with viewed(args, args.gcs):
        return fly(args)
