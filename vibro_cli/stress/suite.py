"""The checks by name, their execution, and their table as text, plain values and a folder."""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from vibro_cli.errors import VibroError
from vibro_cli.grids.solving import columns_of_records
from vibro_cli.progress import WORK
from vibro_cli.storage.files import json_bytes, write_folder
from vibro_cli.storage.tables import parquet_bytes, to_arrow
from vibro_cli.stress.scenes import Finding, Plan
from vibro_cli.systems import NAMES as SYSTEMS
from vibro_cli.systems import system_named
from vibro_cli.systems.columns import Table, count, flag, number, word

# Module of the function ``check_NAME`` of each check, the quick checks first. The check of a system
# is ``check`` in the module ``stress`` of the system's folder, if there is one.
OF_SYSTEMS = tuple(name for name in SYSTEMS[1:] if system_named(name).has_part("stress"))
HOMES = {
    "elliptic": "elliptic",
    "crest": "impacts",
    "impacts": "impacts",
    "accumulation": "impact_laws",
    "cradle": "impact_laws",
    "symmetry": "symmetry",
    "extremes": "extremes",
    "limits": "extremes",
    "energy": "impact_laws",
    **dict.fromkeys(OF_SYSTEMS, ""),
    "turning": "impacts",
    "tangent": "digits",
    "drawn": "physics",
    "digits": "digits",
    "contacts": "first_contacts",
}
NAMES = tuple(HOMES)

# Number of processes in the long form.
WORKERS = 2


class MissingLibrary(VibroError):
    """Raised if a library that only this suite needs is not installed."""


def findings_of(name: str, plan: Plan) -> list[Finding]:
    """Run one check and return its findings."""
    check: Callable[[Plan], list[Finding]]
    if name in OF_SYSTEMS:
        check = system_named(name).part("stress").check
    else:
        check = getattr(import_module(f"vibro_cli.stress.{HOMES[name]}"), f"check_{name}")
    findings = check(plan)
    if name == "tangent":
        for kind in map(system_named, OF_SYSTEMS):
            findings += kind.part("stress").check_tangent(plan) if kind.exponents else []
    for finding in findings:
        finding.check = name
    return findings


def run(plan: Plan, names: Sequence[str]) -> Iterator[Finding]:
    """Run the named checks (all if empty) and yield their findings in the order of ``NAMES``.

    In the long form, two checks run at a time, each in its own process.

    Raises MissingLibrary, before any check, if mpmath is not installed.
    """
    if find_spec("mpmath") is None:
        raise MissingLibrary("mpmath is missing; install it with: pip install 'vibro-cli[stress]'")
    chosen = [name for name in NAMES if not names or name in names]
    if not plan.full or len(chosen) == 1:
        for name in chosen:
            WORK.report(name)
            yield from findings_of(name, plan)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(WORKERS, mp_context=context) as workers:
        found = workers.map(findings_of, chosen, [plan] * len(chosen))
        for name in chosen:
            WORK.report(name)
            yield from next(found)


TABLE = Table(
    "stress",
    "one quantity on one set of cases",
    (
        word("check", "name of the check (--only)"),
        word("quantity", "what is measured, with its unit"),
        word("tried", "what it was measured on"),
        count("cases", "number of cases"),
        number("worst", "", "the greatest value found"),
        number("mark", "", "greatest value allowed (null: the worst value is only reported)", True),
        flag("met", "whether the mark is met"),
        word("scenario", "file of the scenario of the worst case", nullable=True),
    ),
)


def line_of(finding: Finding) -> str:
    """Return a finding as one line of text."""
    verdict = "info" if finding.mark is None else ("met" if finding.met else "MISSED")
    mark = "" if finding.mark is None else f" (mark {finding.mark:.3g})"
    return (
        f"{verdict:6}  {finding.check:12}  {finding.quantity}: {finding.worst:.3g}{mark}; "
        f"{finding.cases} cases: {finding.tried}"
    )


def record_of(finding: Finding) -> dict[str, Any]:
    """Return a finding as plain values, with None if the worst value is not finite."""
    record = asdict(finding) | {"met": finding.met}
    record["worst"] = finding.worst if math.isfinite(finding.worst) else None
    return record


def write(findings: Sequence[Finding], plan: Plan, target: Path) -> None:
    """Write the table and the scenario of every worst case to a folder.

    Raises FolderRefused if ``target`` exists and was not written by this program, and OSError if
    it cannot be written.
    """
    files, records = dict[str, bytes](), []
    for row, finding in enumerate(findings, 1):
        name = None
        if finding.scenario is not None:
            name = f"{finding.check}_{row}.json"
            files[name] = json_bytes(finding.scenario)
        records.append(asdict(finding) | {"met": finding.met, "scenario": name})
    columns = columns_of_records(records, TABLE)
    files["stress.parquet"] = parquet_bytes(to_arrow(TABLE, columns, asdict(plan)))
    write_folder("stress", target, files, asdict(plan))
