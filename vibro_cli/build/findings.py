"""What is mechanically wrong with a scenario, gathered and told at once."""

from __future__ import annotations

from vibro_cli.scenario.base import ScenarioTable
from vibro_cli.scenario.problems import Problem, ScenarioError

# Within these bounds no product or quotient of the mechanics leaves the range of doubles.
SIZES = (1e-30, 1e30)
# Beyond it the sum of two times, or a time in units of a period, leaves that range.
LONGEST = 1e300


class Findings:
    """Collects what is wrong, each with its place in the scenario."""

    def __init__(self, scenario: ScenarioTable) -> None:
        self._scenario = scenario
        self.problems: list[Problem] = []

    def add(self, path: str, found: str, expected: str) -> None:
        """Add what was found at a key, and what was expected there."""
        place = self._scenario.place(path)
        self.problems.append(Problem.at(place, path, found, expected))

    def settle(self) -> None:
        """Raise everything found so far, in the order of the file."""
        if self.problems:
            by_place = sorted(self.problems, key=lambda found: (found.line or 0, found.column or 0))
            raise ScenarioError(by_place)
