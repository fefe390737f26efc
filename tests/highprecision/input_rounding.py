"""Which rows of the reference files no program can reproduce to the marks that starts from doubles.

The files give decimals; a program reads the doubles nearest to them. The twin runs both, to 40
digits: where the two differ by more than a row's mark, the difference is owed to the rounding of
the inputs alone. ``python -m tests.highprecision.input_rounding`` writes the table of those rows to
``input_rounding.json``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from tests import references
from tests.references import QUANTITIES

TABLE = Path(__file__).with_suffix(".json")


class Excess(NamedTuple):
    """One quantity of one row (from 1) that the rounding of the inputs moves beyond its mark."""

    file: str
    row: int
    quantity: str
    mark: float
    difference: float


def computed() -> Iterator[Excess]:
    """Return all such rows, from the twin."""
    for name in references.NAMES:
        doubles, decimals = references.twin_of_doubles(name), references.twin_of_decimals(name)
        for row, (ours, exact) in enumerate(zip(doubles, decimals, strict=True)):
            for quantity, (_, value) in QUANTITIES.items():
                mark = references.mark(quantity, row)
                off = references.deviation(quantity, value(ours), value(exact), exact)
                if off > mark:
                    yield Excess(name, row + 1, quantity, mark, float(f"{off:.2g}"))


def committed() -> list[Excess]:
    """Return the table as it was committed."""
    return [Excess(*row) for row in json.loads(TABLE.read_text(encoding="utf-8"))["rows"]]


def main() -> None:
    """Write the table."""
    rows = ",\n".join("  " + json.dumps(list(row)) for row in computed())
    columns = json.dumps(list(Excess._fields))
    TABLE.write_text(f'{{"columns": {columns},\n "rows": [\n{rows}\n]}}\n', encoding="utf-8")


if __name__ == "__main__":
    main()
