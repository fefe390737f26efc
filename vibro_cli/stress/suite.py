"""The checks by name, and running them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib import import_module

from vibro_cli.stress.fifty_digits import multiprecision
from vibro_cli.stress.finding import Finding, Plan

# Each is a module beside this one with a function ``check``; the quick ones first.
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
    "contacts",
)


def run(plan: Plan, names: Sequence[str]) -> Iterator[Finding]:
    """Run the checks of these names (all when empty), in the order of ``NAMES``."""
    multiprecision()  # so that its absence is told before anything else
    for name in NAMES:
        if not names or name in names:
            check: Callable[[Plan], list[Finding]]
            check = import_module(f"vibro_cli.stress.{name}").check
            yield from check(plan)
