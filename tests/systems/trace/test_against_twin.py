"""The solver against its high-precision twin, which starts from the same doubles."""

from __future__ import annotations

import pytest

from tests import references
from tests.references import QUANTITIES, solved

pytestmark = pytest.mark.long

# The mark: the first ten collisions within 64 eps x the measured amplification of an input change.
FIRST = 10
ALLOWED = 64 * 2.0**-52


@pytest.mark.parametrize("name", references.NAMES)
def test_first_collisions(name: str) -> None:
    run, impacts = references.run(name), references.twin_of_doubles(name)
    grown = references.amplified(name)
    for row, impact in enumerate(impacts[:FIRST]):
        for quantity, (_, value) in QUANTITIES.items():
            error = float(abs(solved(run, quantity, row) - value(impact)))
            assert error <= ALLOWED * grown[quantity][row], (row + 1, quantity)
