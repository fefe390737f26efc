"""What is mechanically wrong with a scenario, gathered and told at once."""

from __future__ import annotations

from collections.abc import Iterable

from vibro_cli.scenario.base import ScenarioTable
from vibro_cli.scenario.problems import Problem, ScenarioError

# Within these bounds no product or quotient of the mechanics leaves the range of doubles.
SIZES = (1e-30, 1e30)
# Beyond it the sum of two times, or a time in units of a period, leaves that range.
LONGEST = 1e300

Given = tuple[str, float | None]
"""A key of the scenario and its number, None where none is given."""


class Findings:
    """Collects what is wrong, each with its place in the scenario."""

    def __init__(self, scenario: ScenarioTable) -> None:
        self._scenario = scenario
        self.problems: list[Problem] = []

    def add(self, path: str, found: str, expected: str) -> None:
        """Add what was found at a key, and what was expected there."""
        place = self._scenario.place(path)
        self.problems.append(Problem.at(place, path, found, expected))

    def add_wrong_lengths(self, given: Iterable[Given]) -> None:
        """Add the lengths (m) that doubles cannot compute with."""
        low, high = SIZES
        for path, length in given:
            if length is not None and not low <= length <= high:
                self.add(path, repr(length), f"a length from {low} to {high} m")

    def add_wrong_numbers(self, given: Iterable[Given]) -> None:
        """Add the places, speeds and rates that doubles cannot compute with."""
        high = SIZES[1]
        for path, value in given:
            if value is not None and abs(value) > high:
                self.add(path, repr(value), f"a number from {-high} to {high}")

    def add_wrong_time(self, stop_time: float | None) -> None:
        """Add the end of the run (s) if doubles cannot compute with it."""
        if stop_time is not None and stop_time > LONGEST:
            self.add("stop.time", repr(stop_time), f"a time up to {LONGEST} s")

    def settle(self) -> None:
        """Raise everything found so far, in the order of the file."""
        if self.problems:
            by_place = sorted(self.problems, key=lambda found: (found.line or 0, found.column or 0))
            raise ScenarioError(by_place)
