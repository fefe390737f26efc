"""The fields of the models by path, for messages about them, and the JSON Schema of scenarios.

Errors of pydantic are converted to the style of this package: path, found, expected.
"""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from itertools import pairwise
from threading import RLock
from typing import Any, get_args

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from vibro_cli.errors import listing, similar
from vibro_cli.scenario.base import Table
from vibro_cli.scenario.problems import Fault, KeyPath, shown, suggestion
from vibro_cli.scenario.quantities import Kind
from vibro_cli.systems import system_named

Model = type[Table]


def _models_in(annotation: Any) -> Iterator[Model]:
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for part in get_args(annotation):
        yield from _models_in(part)


def model_at(path: KeyPath, root: Model) -> Model | None:
    """Return the model of the table at a path, or None if there is no table.

    `root` is the model of the whole scenario, here and below.
    """
    model: Model | None = root
    for part in path:
        if isinstance(part, int):
            continue
        field = model.model_fields.get(part) if model is not None else None
        model = None if field is None else next(_models_in(field.annotation), None)
    return model


def field_at(path: KeyPath, root: Model) -> FieldInfo | None:
    """Return the field at a path; for an entry of a list, the field of the list."""
    while path and isinstance(path[-1], int):
        path = path[:-1]
    model = model_at(path[:-1], root) if path else None
    return None if model is None else model.model_fields.get(str(path[-1]))


def kind_at(path: KeyPath, root: Model) -> Kind | None:
    """Return the kind of the single value at a path; None for a table, a list or no field."""
    field = field_at(path, root)
    if field is None:
        return None
    found = _kinds_within(field.annotation) if isinstance(path[-1], int) else field.metadata
    return next((kind for kind in found if isinstance(kind, Kind)), None)


def _kinds_within(annotation: Any) -> Iterator[Any]:
    """Yield the metadata in the annotations of a list's entries, at any depth."""
    for part in get_args(annotation):
        yield from getattr(part, "__metadata__", ())
        yield from _kinds_within(part)


def unit_at(path: KeyPath, root: Model) -> str:
    """Return the unit of the number at a path, or an empty string."""
    kind = kind_at(path, root)
    return "" if kind is None else kind.unit


# In Python 3.11, garbage collection during parsing may let another thread parse too, which corrupts
# the recursion depth of the first parser (SystemError).
_PARSING = RLock()


@cache
def descriptions(model: Model) -> Mapping[str, str]:
    """Return the descriptions of a model's fields, the texts below them in the source."""
    base = model.__base__
    found = dict(descriptions(base)) if base is not None and issubclass(base, Table) else {}
    with _PARSING:
        (declared,) = ast.parse(textwrap.dedent(inspect.getsource(model))).body
    assert isinstance(declared, ast.ClassDef)
    for field, below in pairwise(declared.body):
        if isinstance(field, ast.AnnAssign) and isinstance(below, ast.Expr):
            found[ast.unparse(field.target)] = inspect.cleandoc(ast.literal_eval(below.value))
    return found


def description(path: KeyPath, root: Model) -> str:
    """Return the first part of a field's description, up to a semicolon, or an empty string."""
    model, key = model_at(path[:-1], root), path[-1]
    if model is None or not isinstance(key, str) or key not in model.model_fields:
        return ""
    words = " ".join(descriptions(model).get(key, "").split())
    return words.split("; ")[0].rstrip(".")


@lru_cache(maxsize=8)
def _homes(root: Model) -> dict[str, list[str]]:
    """Return the tables that have each key."""
    homes: dict[str, list[str]] = {}
    for table, model in tables(root, ""):
        for key in model.model_fields:
            homes.setdefault(key, []).append(table)
    return homes


def tables(model: Model, path: str) -> Iterator[tuple[str, Model]]:
    """Yield all tables of a scenario with their paths, in which lists have no index."""
    yield path, model
    for key, field in model.model_fields.items():
        for below in _models_in(field.annotation):
            yield from tables(below, f"{path}.{key}" if path else key)


def known_keys(table: KeyPath, root: Model) -> list[str]:
    """Return the keys that a table may have."""
    model = model_at(table, root)
    return [] if model is None else list(model.model_fields)


def hint(table: KeyPath, key: str, root: Model) -> str:
    """Return the suggestion for an unknown key: a similar key, or a table that has this key."""
    close = suggestion(key, known_keys(table, root))
    if close:
        return close
    homes = [home for home in _homes(root).get(key, []) if home]
    return f' (did you mean "{homes[0]}.{key}"?)' if homes else ""


_EXPECTED = {
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
    "union_tag_not_found": '"stop" or a table {wall = ...}',
    "union_tag_invalid": '"stop" or a table {wall = ...}',
}


def faults(error: ValidationError, root: Model) -> list[Fault]:
    """Return the faults of a scenario, each once; a mistyped key is not reported as missing."""
    details = error.errors(include_url=False)
    found = dict.fromkeys(_fault(item, root) for item in details)
    mistyped = {
        (*loc[:-1], similar(str(loc[-1]), known_keys(loc[:-1], root)))
        for loc in (item["loc"] for item in details if item["type"] == "extra_forbidden")
    }
    return [fault for fault in found if fault.found != "nothing" or fault.loc not in mistyped]


def _fault(details: ErrorDetails, root: Model) -> Fault:
    context: Mapping[str, Any] = details.get("ctx", {})
    kind, value, given = details["type"], details["input"], details["loc"]
    # Tags of unions, such as "<wall>", are not part of the path; an unknown key may look like one.
    loc = tuple(part for part in given if not str(part).startswith("<"))
    if kind == "extra_forbidden":
        loc = (*(part for part in given[:-1] if not str(part).startswith("<")), given[-1])
    if kind == "vibro":
        return Fault(loc, **context)
    if kind == "missing":
        return Fault(loc, "nothing", _needed(loc, root))
    if kind == "extra_forbidden":
        return unknown_key(loc, root)
    return Fault(
        loc, shown(value), _EXPECTED.get(kind, details["msg"][:1].lower() + details["msg"][1:])
    )


def _needed(loc: KeyPath, root: Model) -> str:
    words = description(loc, root)
    key = f'the key "{loc[-1]}"'
    return f"{key}: {words[:1].lower()}{words[1:]}" if words else key


def unknown_key(loc: KeyPath, root: Model) -> Fault:
    """Return the fault of an unknown key, with a suggestion."""
    table, key = loc[:-1], str(loc[-1])
    known = known_keys(table, root)
    expected = f"{listing(known)}{hint(table, key, root)}"
    return Fault(loc, f"the unknown key {shown(key)}", expected, on_key=True)


def settings(root: Model, values: Mapping[str, Any], path: KeyPath = ()) -> str:
    """Return settings of a table on one line with units, inner tables in parentheses."""
    texts = []
    for key, value in values.items():
        if isinstance(value, Mapping):
            texts.append(f"{key} ({settings(root, value, (*path, key))})")
        elif value is not None:
            texts.append(f"{key} = {_with_unit(value, unit_at((*path, key), root))}")
    return ", ".join(texts)


def _with_unit(value: Any, unit: str) -> str:
    if unit == "rad":
        return f"{math.degrees(value):.6g}°"
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return f"{text} {written(unit)}".rstrip()


def written(unit: str) -> str:
    """Return a unit with superscripts: m/s² for m/s^2."""
    return unit.replace("^2", "²").replace("^3", "³")


DIALECT = "https://json-schema.org/draft/2020-12/schema"


# A JSON file may name its schema for editors; `$schema` is not a key of the scenario.
SCHEMA_KEY: dict[str, Any] = {"patternProperties": {r"^\$schema$": {"type": "string"}}}


def identifier(name: str) -> str:
    """Return the `$id` of a schema of this name."""
    return f"urn:vibro:schema:{name}"


def json_schema(system: str = "trace") -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a system's scenarios as plain data."""
    schema = schema_of(system_named(system).model)
    for key in ("name", "collision"):  # their defaults depend on the file and on its bodies
        schema["properties"][key].pop("default", None)
    head = {"$schema": DIALECT, "$id": identifier(system)}
    return {**head, **schema, **SCHEMA_KEY, "title": "vibro scenario"}


def schema_of(root: Model) -> dict[str, Any]:
    """Return the JSON Schema of a model as plain data, with the rules between keys."""
    schema: dict[str, Any] = _cleaned(_described(root))
    for _, model in tables(root, ""):
        if model.rules:
            part = schema if model is root else schema["$defs"][model.__name__]
            part["allOf"] = list(model.rules)
    return schema


def _described(root: Model) -> dict[str, Any]:
    """Return the schema of a model and its inner models, with descriptions of the fields."""
    schema = root.model_json_schema()
    for _, model in tables(root, ""):
        part = schema if model is root else schema["$defs"][model.__name__]
        for key, words in descriptions(model).items():
            if key in part["properties"]:  # the schema of the trace omits `system`
                described = {**part["properties"][key], "description": words}
                part["properties"][key] = dict(sorted(described.items()))
    return schema


def _cleaned(value: Any) -> Any:
    """Return a schema without titles of fields, and without null, which no key allows."""
    if isinstance(value, list):
        return [_cleaned(item) for item in value if item != {"type": "null"}]
    if not isinstance(value, dict):
        return value
    cleaned = {}
    for key, item in value.items():
        if (key == "default" and item is None) or (key == "title" and isinstance(item, str)):
            continue
        if key == "default" and isinstance(item, dict):
            item = {name: part for name, part in item.items() if part is not None}
        if key == "description" and isinstance(item, str):
            item = " ".join(item.split())
        cleaned[key] = _cleaned(item)
    options = cleaned.get("anyOf")
    if isinstance(options, list) and len(options) == 1:
        return {**cleaned.pop("anyOf")[0], **cleaned}
    return cleaned


def keys_of(schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], bool]]:
    """Yield the key paths of a JSON Schema, their nodes and whether they are required.

    `[i]` stands for any entry of a list; entries have their own paths.
    """
    yield from _below(schema, "", schema["$defs"])


def _below(
    node: dict[str, Any], path: str, definitions: dict[str, Any]
) -> Iterator[tuple[str, dict[str, Any], bool]]:
    if "$ref" in node:
        node = definitions[node["$ref"].rpartition("/")[2]]
    children = [
        (f"{path}.{key}" if path else key, child, key in node.get("required", ()))
        for key, child in node.get("properties", {}).items()
    ]
    if isinstance(node.get("items"), dict):
        children.append((f"{path}[i]", node["items"], False))
    for below, child, needed in children:
        yield below, child, needed
        yield from _below(child, below, definitions)
    for branch in (*node.get("anyOf", ()), *node.get("oneOf", ())):
        yield from _below(branch, path, definitions)
