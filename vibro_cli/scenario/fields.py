"""The fields of the models by path: to suggest a key, and to say what a missing one is."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, get_args

from pydantic import BaseModel

from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import KeyPath, suggestion

Model = type[BaseModel]


def _models_in(annotation: Any) -> Iterator[Model]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models_in(part)


def model_at(path: KeyPath) -> Model | None:
    """Return the model of the table at a path, or None where the path leads to no table."""
    model: Model | None = Scenario
    for part in path:
        if isinstance(part, int):
            continue
        field = model.model_fields.get(part) if model is not None else None
        model = None if field is None else next(_models_in(field.annotation), None)
    return model


def description(path: KeyPath) -> str:
    """Return the first sentence that describes a field, or an empty text."""
    model, key = model_at(path[:-1]), path[-1]
    if model is None or not isinstance(key, str) or key not in model.model_fields:
        return ""
    words = " ".join((model.model_fields[key].description or "").split())
    return words.split("; ")[0].rstrip(".")


@lru_cache(maxsize=1)
def _homes() -> dict[str, list[str]]:
    """Return for each key the tables it belongs to."""
    homes: dict[str, list[str]] = {}
    tables = ("", "trace", "trace.arcs", "trace.turning", "balls", "collision", "stop", "output")
    for table in tables:
        model = model_at(tuple(part for part in table.split(".") if part))
        for key in model.model_fields if model is not None else ():
            homes.setdefault(key, []).append(table)
    return homes


def known_keys(table: KeyPath) -> list[str]:
    """Return the keys a table may have."""
    model = model_at(table)
    return [] if model is None else list(model.model_fields)


def hint(table: KeyPath, key: str) -> str:
    """Return the suggestion for an unknown key: a similar one, or the table it belongs to."""
    close = suggestion(key, known_keys(table))
    if close:
        return close
    homes = [home for home in _homes().get(key, []) if home]
    return f' (did you mean "{homes[0]}.{key}"?)' if homes else ""
