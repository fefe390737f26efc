"""A known scenario with other numbers in some places, without reading it anew."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vibro_cli.scenario import Scenario
from vibro_cli.scenario.problems import KeyPath

Given = Mapping[KeyPath, Any]


def changed(known: Scenario, values: Given) -> Scenario:
    """Return a scenario with other numbers, each of which its key allows, or arrays of numbers."""
    values = dict(values)
    for_all = values.pop(("collision", "k"), None)
    if for_all is not None:
        values |= {("collision", "k", n): for_all for n in range(len(known.collision.k))}
    new: Scenario = _changed(known, values)
    return new


def _changed(known: Any, values: Given) -> Any:
    """A table, list or value with others in some places."""
    if () in values:
        return values[()]
    within: dict[Any, dict[KeyPath, Any]] = {}
    for path, value in values.items():
        within.setdefault(path[0], {})[path[1:]] = value
    if isinstance(known, tuple):
        return tuple(
            _changed(one, within[n]) if n in within else one for n, one in enumerate(known)
        )
    updates = {str(key): _changed(getattr(known, key), given) for key, given in within.items()}
    return known.model_copy(update=updates)
