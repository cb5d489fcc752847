"""Limits, JSON and JUnit XML of many flights, for continuous integration."""

import json
import sys
from argparse import Namespace
from collections.abc import Iterable
from math import isnan
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from colibri.analysis.limits import ReportLimit, above, loss_exceeds
from colibri.campaigns.definition import Metric
from colibri.campaigns.flight_table import FlightTable
from colibri.campaigns.flights import FlightResult, Verdict
from colibri.common.process.lifecycle import EXIT_FAILED


def with_limits(metrics: Iterable[Metric], limits: Iterable[ReportLimit]) -> tuple[Metric, ...]:
    kept = list(metrics)
    names = {metric.name for metric in kept}
    return (*kept, *(Metric(key) for key in dict.fromkeys(limit.key for limit in limits) if key not in names))


def handed_over(table: FlightTable, args: Namespace) -> int:
    """Write `--json` and `--junit`, report exceeded limits, and return the exit code."""
    lost = loss_exceeds(args.fail_lost, len(table.flown) - table.verdicts[Verdict.FLOWN], len(table.flown))
    reasons = [_above(table, each, args.fail_above) for each in table.flown]
    wrong = [lost] if lost else []
    for limit in args.fail_above:
        of_key = [reason for each in reasons for reason in each if reason.startswith(f"{limit.key} ")]
        if of_key:
            words = " or unknown" if any("is missing" in each for each in of_key) else ""
            where = f"in {len(of_key)} of {len(reasons)} flights"
            wrong.append(f"--fail-above: {limit.key} is above {limit.value:g}{words} {where}")
    if args.json:
        sys.stdout.write(json.dumps(_facts(table, args.out, wrong), indent=1) + "\n")
    if args.junit is not None:
        _write_junit(table, reasons, args.junit, lost=bool(lost))
    for line in wrong:
        sys.stderr.write(f"colibri: error: {line}\n")
    return EXIT_FAILED if wrong else 0


def _above(table: FlightTable, each: FlightResult, limits: Iterable[ReportLimit]) -> list[str]:
    if each.verdict is not Verdict.FLOWN:
        return []
    values = dict(zip((metric.name for metric in table.campaign.metrics), each.metrics, strict=True))
    return [reason for limit in limits if (reason := above(limit, values[limit.key]))]


def _facts(table: FlightTable, out: Path, wrong: list[str]) -> dict[str, Any]:
    headings, rows = table.summary()
    return {
        "name": table.campaign.name,
        "out": str(out),
        "flights": len(table.flown),
        "verdicts": {str(verdict): count for verdict, count in table.verdicts.items()},
        "exceeded": wrong,
        "notes": table.notes,
        "summary": [dict(zip(headings, map(_value, row), strict=True)) for row in rows],
    }


def _value(cell: str) -> Any:
    for kind in (int, float):
        try:
            value = kind(cell)
        except ValueError:
            continue
        return None if isnan(value) else value
    return cell or None


def _write_junit(table: FlightTable, reasons: list[list[str]], path: Path, *, lost: bool) -> None:
    suite = ElementTree.Element("testsuite", name=table.campaign.name, tests=str(len(reasons)))
    factors = len(table.campaign.factors) + 2
    counts = {"failure": 0, "skipped": 0}
    for each, row, above_limit in zip(table.flown, table.rows(), reasons, strict=True):
        named = ", ".join(map("=".join, zip(table.headings[1:factors], row[1:factors], strict=True)))
        names = {"classname": table.campaign.name, "name": f"flight {row[0]}: {named}"}
        case = ElementTree.SubElement(suite, "testcase", names)
        message = "; ".join(above_limit) or each.why
        if each.verdict is not Verdict.FLOWN or above_limit:
            tag = "failure" if above_limit or lost else "skipped"
            counts[tag] += 1
            ElementTree.SubElement(case, tag, message=f"{each.verdict}: {message}")
    suite.set("failures", str(counts["failure"]))
    suite.set("errors", "0")
    suite.set("skipped", str(counts["skipped"]))
    path.parent.mkdir(parents=True, exist_ok=True)
    ElementTree.ElementTree(suite).write(path, encoding="utf-8", xml_declaration=True)
