"""`colibri doctor`."""

from argparse import Namespace

from colibri.common.process.arguments import ArgumentParser, positive

GCS = "udpout:127.0.0.1:14550"


def add_options(parser: ArgumentParser) -> None:
    add = parser.value
    add(
        "--gcs",
        "URL",
        "call a ground station as a vehicle does, and wait for its heartbeat: "
        f"udpout:, udpin:, tcp: or tcpin:HOST:PORT, or serial:DEVICE:BAUD (default {GCS})",
        nargs="?",
        const=GCS,
    )
    add("--within", "S", "how long to wait for it", type=positive, default=10.0)


def run(args: Namespace) -> int:
    from colibri.common.process.lifecycle import one_line
    from colibri.doctor.checks import examine_as_told

    with one_line():
        return examine_as_told(args)
