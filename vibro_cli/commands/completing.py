"""What the shell offers when TAB is pressed: scenario files, keys after --set, the gallery.

Nothing here may print or fail: what cannot be found out is not offered.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

_SUFFIXES = (".toml", ".json", ".yaml", ".yml")


def scenario_files(incomplete: str) -> list[str]:
    """Folders and scenario files that begin so."""
    return _paths(incomplete, _SUFFIXES)


def table_files(incomplete: str) -> list[str]:
    """Folders and parquet files that begin so."""
    return _paths(incomplete, (".parquet",))


def _paths(incomplete: str, suffixes: tuple[str, ...]) -> list[str]:
    head, slash, tail = incomplete.rpartition("/")
    folder = Path(head + slash or ".").expanduser()
    found = []
    try:
        for entry in sorted(folder.iterdir()):
            hidden = entry.name.startswith(".") and not tail.startswith(".")
            if hidden or not entry.name.startswith(tail):
                continue
            if entry.is_dir():
                found.append(f"{head}{slash}{entry.name}/")
            elif entry.suffix.lower() in suffixes:
                found.append(f"{head}{slash}{entry.name}")
    except OSError:
        return []
    return found


def gallery_names(incomplete: str) -> list[str]:
    """Scenarios and grids of the gallery that begin so."""
    from vibro_cli.scenario.gallery import grid_names, names

    return [name for name in [*names(), *grid_names()] if name.startswith(incomplete)]


def scenario_keys(incomplete: str) -> list[str]:
    """Key paths of scenarios that begin so, `balls[1].angle=`; after `=` the words there are."""
    from vibro_cli.scenario.json_schema import json_schema

    path, equals, word = incomplete.partition("=")
    keys = dict(scenario_paths(json_schema()))
    if equals:
        words = keys.get(_first_entry(path), [])
        return [f"{path}={choice}" for choice in words if choice.startswith(word)]
    return [f"{_same_entry(key, path)}=" for key in keys if _same_entry(key, path).startswith(path)]


def _first_entry(path: str) -> str:
    """A key path with every number in brackets made 1: one entry of a list stands for all."""
    import re

    return re.sub(r"\[\d+\]", "[1]", path)


def _same_entry(key: str, typed: str) -> str:
    """A key path with the numbers in brackets that were typed."""
    import re

    numbers = iter(re.findall(r"\[(\d+)\]", typed))
    return re.sub(r"\[1\]", lambda found: f"[{next(numbers, '1')}]", key)


def scenario_paths(schema: dict[str, Any]) -> Iterator[tuple[str, list[str]]]:
    """Every key path of a scenario, `[1]` for any entry of a list, with the words it may be."""
    yield from _below(schema, schema, "", 0)


def _below(
    node: dict[str, Any], schema: dict[str, Any], path: str, depth: int
) -> Iterator[tuple[str, list[str]]]:
    if depth > 12:
        return
    if "$ref" in node:
        node = schema["$defs"][node["$ref"].rpartition("/")[2]]
    branches = [*node.get("anyOf", ()), *node.get("oneOf", ())]
    words = [str(word) for part in (node, *branches) for word in _words(part)]
    if path and not node.get("properties") and "items" not in node:
        yield path, words
    for branch in branches:
        for key, more in _below(branch, schema, path, depth + 1):
            if key != path:
                yield key, more
    for name, child in node.get("properties", {}).items():
        yield from _below(child, schema, f"{path}.{name}" if path else name, depth + 1)
    items = node.get("items")
    if isinstance(items, dict):
        yield from _below(items, schema, f"{path}[1]", depth + 1)


def _words(node: dict[str, Any]) -> list[Any]:
    return [*node.get("enum", ()), *([node["const"]] if "const" in node else [])]
