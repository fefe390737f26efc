"""The checks by name, and running them."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module

from vibro_cli.stress.fifty_digits import multiprecision
from vibro_cli.stress.finding import Finding, Plan
from vibro_cli.systems import NAMES as SYSTEMS

# Each is a module beside this one with a function ``check``, or ``stress`` in the folder of a
# system; the quick ones first.
NAMES = (
    "elliptic",
    "crest",
    "impacts",
    "accumulation",
    "cradle",
    "symmetry",
    "extremes",
    "limits",
    "energy",
    *SYSTEMS[1:],
    "turning",
    "tangent",
    "drawn",
    "digits",
    "contacts",
)


# Processes of the long form.
WORKERS = 2


def findings_of(name: str, plan: Plan) -> list[Finding]:
    """What one check finds."""
    check: Callable[[Plan], list[Finding]]
    home = f"systems.{name}.stress" if name in SYSTEMS else f"stress.{name}"
    check = import_module(f"vibro_cli.{home}").check
    return check(plan)


def run(plan: Plan, names: Sequence[str]) -> Iterator[Finding]:
    """Run the checks of these names (all when empty) and yield in the order of ``NAMES``.

    Those of the long form run two at a time, each in a process.
    """
    multiprecision()  # so that its absence is told before anything else
    chosen = [name for name in NAMES if not names or name in names]
    if not plan.full or len(chosen) == 1:
        for name in chosen:
            yield from findings_of(name, plan)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(WORKERS, mp_context=context) as workers:
        for findings in workers.map(findings_of, chosen, [plan] * len(chosen)):
            yield from findings
