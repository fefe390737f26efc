"""What a check reports: what was tried, the worst reached, and whether it meets its mark."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

Document = dict[str, Any]


@dataclass(frozen=True)
class Plan:
    """How much is tried."""

    seed: int
    full: bool
    cases: int | None = None
    """How many scenes the checks draw that draw whole scenes; None for as many as they think."""

    def amount(self, short: int, long: int) -> int:
        """A number of cases for the short or the full form."""
        return long if self.full else short

    def scenes(self, short: int, long: int) -> int:
        """A number of whole scenes, unless it is given."""
        return self.amount(short, long) if self.cases is None else self.cases


@dataclass(frozen=True)
class Finding:
    """One line of the table."""

    check: str
    """Name of the check that made it (the word for ``--only``)."""
    quantity: str
    """What is measured, with its unit."""
    tried: str
    """What it was measured on."""
    cases: int
    """How many cases that were."""
    worst: float
    """The greatest value found."""
    mark: float | None
    """What it may be at most; None where it is only told."""
    scenario: Document | None = None
    """The scenario of the worst case."""

    @property
    def met(self) -> bool:
        """Whether the mark is met (a value that is only told meets it; nan never does)."""
        return self.mark is None or self.worst <= self.mark


class Worst:
    """Keeps the greatest of many values, and where it was found; nan counts as infinite."""

    def __init__(self) -> None:
        self.value = 0.0
        self.cases = 0
        self.scenario: Document | None = None

    def take(self, value: float, scenario: Document | None = None) -> None:
        """Take one value into account."""
        self.cases += 1
        value = float("inf") if value != value else float(value)
        if value > self.value or self.scenario is None:
            self.value, self.scenario = max(value, self.value), scenario

    def finding(self, check: str, quantity: str, tried: str, mark: float | None) -> Finding:
        """Report the worst of all cases; the texts and the mark are those of :class:`Finding`."""
        return Finding(check, quantity, tried, self.cases, self.value, mark, self.scenario)
