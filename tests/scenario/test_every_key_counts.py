"""Every key that is read from a file is used: the built system depends on each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.scenario.texts import parse_any
from vibro_cli.scenario import gallery
from vibro_cli.scenario.base import Sampling, Table
from vibro_cli.systems import NAMES, system_named

WORDS = {"name", "system"}  # not of what is solved
# Keys of tables that several systems have, which one of them refuses, or knows from another key.
UNASKED = {("springs", "touching")}  # where there is no position
# For keys of which the gallery has only alternatives.
SQUARE = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]]
OTHERS: list[tuple[str, dict[str, Any]]] = [
    ("turning_valley", {"trace.turning.x": 0.0}),
    ("two_disks", {"balls[1].density": 7800.0, "balls[1].thickness": 0.1, "balls[2].omega": 1.0}),
    ("two_disks", {"balls[2].touching": "previous"}),
    ("skew_impact", {"wall": {"shape": "polygon", "corners": SQUARE, "k": 1.0}}),
    ("skew_impact", {"wall": {"shape": "circle", "radius": 9.0, "k": 1.0}}),
]


def tables(value: Any) -> Iterator[Table]:
    """A table of a scenario, and all tables in it."""
    if isinstance(value, Table):
        yield value
        yield from tables(tuple(value.__dict__.values()))
    elif isinstance(value, tuple):
        for one in value:
            yield from tables(one)


@pytest.mark.parametrize("system", NAMES)
def test_what_is_solved_asks_for_every_key(system: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenarios = [parse_any(gallery.text(name)) for name in gallery.names()]
    scenarios += [parse_any(gallery.text(name)).replace(changes) for name, changes in OTHERS]
    asked = set()

    def get(table: Table, name: str) -> Any:
        asked.add((object.__getattribute__(table, "__class__"), name))
        return object.__getattribute__(table, name)

    kind, keys = system_named(system), set()
    for scenario in scenarios:
        if scenario.system != system:
            continue
        # Output is passed on as it is: a key without a place there is an error.
        of = [table for table in tables(scenario) if not isinstance(table, Sampling)]
        keys |= {(type(table), key) for table in of for key in type(table).model_fields}
        with monkeypatch.context() as patch:
            patch.setattr(Table, "__getattribute__", get, raising=False)
            kind.build(scenario)
            kind.limits(scenario)
            kind.wanted(scenario)
    exempt = {key for name, key in UNASKED if name == system}
    assert len(keys) > 10
    assert {key for key in keys - asked if key[1] not in WORDS | exempt} == set()
