"""`make golden`: golden flights under every variation; 1 if any hash differs."""

import argparse
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from colibri.common.process.lifecycle import EXIT_FAILED, fail, fail_interrupted
from tools.golden.variations import (
    ROOT,
    GoldenHashes,
    Variation,
    VariationError,
    fly,
    other_pythons,
    set_up,
    variations,
)


def main(argv: Sequence[str] | None = None) -> int:
    args = _arguments(argv)
    try:
        if args.pythons:
            _set_up_pythons()
        return _fly_all(_chosen(args), args)
    except KeyboardInterrupt as ended:
        fail_interrupted(ended)


def table(flown: Mapping[str, GoldenHashes]) -> str:
    names = list(flown)
    flights = list(dict.fromkeys(flight for each in flown.values() for flight in each.hashes))
    differing = {name: each.differing() for name, each in flown.items()}
    rows = [["flight", *names], ["---", *("---" for _ in names)]]
    rows += [[flight, *("**differs**" if flight in differing[name] else "=" for name in names)] for flight in flights]
    rows.append(["took", *(f"{each.took_s:.0f} s" for each in flown.values())])
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _fly_all(chosen: Sequence[Variation], args: argparse.Namespace) -> int:
    flown: dict[str, GoldenHashes] = {}
    failed = False
    for variation in chosen:
        obstacle = variation.obstacle()
        if obstacle:
            print(f"{variation.name}: not flown: {obstacle}", flush=True)
            continue
        with TemporaryDirectory(prefix="golden-") as out:
            try:
                flown[variation.name] = done = fly(variation, Path(out), args.link, args.only)
            except VariationError as error:
                print(f"FAILED: {error}", flush=True)
                failed = True
                continue
        differing = done.differing()
        failed |= bool(differing)
        print(f"{variation.name}: {len(done.hashes)} flights in {done.took_s:.0f} s, {len(differing)} differ")
        for flight, (expected, found) in differing.items():
            print(f"  {flight}: expected {expected[:16]}, found {found[:16] or 'none: it did not end'}")
        sys.stdout.flush()
    if args.table:
        args.table.write_text(table(flown), encoding="utf-8")
    return EXIT_FAILED if failed else 0


def _chosen(args: argparse.Namespace) -> list[Variation]:
    known = {variation.name: variation for variation in variations()}
    for name in args.variation:
        if name not in known:
            fail(f"--variation {name}: there is no such variation; there are {', '.join(known)}")
    if args.pythons:
        return [variation for name, variation in known.items() if name.startswith("python-")]
    return [variation for name, variation in known.items() if not args.variation or name in args.variation]


def _set_up_pythons() -> None:
    for version, python in other_pythons().items():
        print(f"Python {version}: {python}, in .venv-{version} from requirements.lock", flush=True)
        try:
            set_up(ROOT, version, python)
        except subprocess.CalledProcessError as error:
            words = (error.stderr or "").strip().splitlines()
            fail(f"cannot set up .venv-{version}: {words[-1] if words else error}", EXIT_FAILED)


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tools.golden", description=__doc__)
    parser.add_argument("--link", default="memory", choices=("memory", "udp"), help="(default %(default)s)")
    parser.add_argument("--only", action="append", default=[], metavar="FLIGHT", help="only this; may be repeated")
    parser.add_argument("--variation", action="append", default=[], metavar="NAME", help="only this; may be repeated")
    parser.add_argument(
        "--pythons", action="store_true", help="set up each other Python in .venv-3.N, and fly under them"
    )
    parser.add_argument("--table", type=Path, metavar="FILE", help="write flights × variations there, as Markdown")
    return parser.parse_args(argv)


if __name__ == "__main__":
    sys.exit(main())
