"""Overrides of a scenario's values from the command line: `balls[1].angle=-60 deg`."""

from __future__ import annotations

import datetime
import tomllib
from collections.abc import Collection
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from vibro_cli.scenario import fields
from vibro_cli.scenario.base import AnyScenario, model_of, plain
from vibro_cli.scenario.fields import unknown_key
from vibro_cli.scenario.forms import check_toml
from vibro_cli.scenario.problems import Fault, FormError, KeyPath, parsed_path, path_text, shown

_LONGEST = 100_000


class OverrideError(Exception):
    """An override that cannot be applied, as a fault without a place."""

    def __init__(self, fault: Fault) -> None:
        super().__init__(fault)
        self.fault = fault


@dataclass(frozen=True)
class Override:
    """One override: the path, the value and the text it was given as."""

    path: KeyPath
    value: Any
    text: str


def parse(text: str) -> Override:
    """Return the override of a text `path=value`.

    The value is one of TOML (`0.8`, `"0.4 m"`, `[1, 0.9]`, `{wall = 0.8}`); what is not, is a
    word or text without quotes (`hedrih`, `-60 deg`).

    Raises
    ------
    OverrideError
        If there is no `=`, or no path before it.
    """
    path, equals, value = text.partition("=")
    if not equals:
        raise OverrideError(Fault((), shown(text), "path=value, such as balls[1].angle=-1.2"))
    return Override(_path(path), parse_value(value.strip()), text)


def given(path: str, value: Any) -> Override:
    """Return the override of a path by a value of Python: a number, a text, a list, a dictionary.

    Numbers and arrays of numpy are taken as those of Python.

    Raises
    ------
    OverrideError
        If the text is no path.
    """
    return Override(_path(path), plain(value), f"{path}={value!r}")


def _path(text: str) -> KeyPath:
    try:
        return parsed_path(text)
    except ValueError:
        expected = "a path such as collision.k or balls[1].angle, counted from 1"
        raise OverrideError(Fault((), shown(text), expected)) from None


def parse_value(text: str) -> Any:
    """Return the value of a text: one of TOML, or else the text itself."""
    if len(text) > _LONGEST:
        raise ValueError("too long")
    try:
        check_toml(f"value = {text}")
        table = tomllib.loads(f"value = {text}")
    except (FormError, ValueError, RecursionError):
        return text
    value = table["value"]
    dated = isinstance(value, (datetime.date, datetime.time))
    return text if len(table) > 1 or dated else value


def apply(
    data: dict[str, Any], path: KeyPath, value: Any, given: Collection[KeyPath] = ()
) -> dict[str, Any]:
    """Return a copy of a scenario's data with one value changed.

    Tables that are missing on the way are made. Of keys that exclude one another (`density` and
    `mass`) the new one replaces the other, unless that one was an override too.

    Parameters
    ----------
    data : dict
        The scenario as plain data.
    path : KeyPath
        Where the value is, counted from 0.
    value : object
        The new value.
    given : collection of KeyPath
        Paths that other overrides have set.

    Raises
    ------
    OverrideError
        If the path is not one of a scenario, or counts beyond a list.
    """
    changed = deepcopy(data)
    root = model_of(data)
    if path[:2] == ("collision", "k") and len(path) == 3:
        _spread_restitution(changed, root)
    place: Any = changed
    for depth in range(len(path) - 1):
        place = _entered(place, path, depth, root)
    _check_step(place, path, root)
    for group in root.alternatives if isinstance(place, dict) else ():
        for other in group if path[-1] in group else ():
            if (*path[:-1], other) not in given:
                place.pop(other, None)
    place[path[-1]] = value
    return changed


def _spread_restitution(data: dict[str, Any], root: type[AnyScenario]) -> None:
    """Write one k for all pairs as a list, so that the k of one pair can be changed."""
    spread = root.prepared(data)
    if "collision" in spread:
        data["collision"] = spread["collision"]


def _entered(place: Any, path: KeyPath, depth: int, root: type[AnyScenario]) -> Any:
    """Return the table or list that one step of the path leads to."""
    part, here = path[depth], path[: depth + 1]
    _check_step(place, here, root)
    following = path[depth + 1]
    if isinstance(part, int):
        return place[part]
    if isinstance(following, int):
        _check_list(place.get(part), here)
    elif isinstance(place.get(part), list):
        count = len(place[part])
        expected = f"a number from 1 to {count} after it: {path_text(here)}[1].{following}"
        raise OverrideError(Fault(here, path_text(here), expected))
    elif not isinstance(place.get(part), dict):
        if fields.model_at(here, root) is None:
            raise OverrideError(Fault(here, f"{path_text(here)} as a table", "a single value"))
        place[part] = {}
    return place[part]


def _check_step(place: Any, path: KeyPath, root: type[AnyScenario]) -> None:
    """Check that the last part of a path is a key or a number of the place it is in."""
    part = path[-1]
    if isinstance(part, int):
        _check_list(place, path[:-1])
        if part >= len(place):
            found = f"{path_text(path)} of {len(place)}"
            raise OverrideError(Fault(path, found, f"a number from 1 to {len(place)}"))
    elif not isinstance(place, dict) or part not in fields.known_keys(path[:-1], root):
        raise OverrideError(unknown_key(path, root))


def _check_list(value: Any, path: KeyPath) -> None:
    if not isinstance(value, list) or not value:
        found = f"{path_text(path)} as a list" if value is None else shown(value)
        raise OverrideError(Fault(path, found, f"a value of {path_text(path)} as a whole"))
