"""The fields of the models by path, to say what is wrong with one; the JSON Schema of scenarios.

Errors of pydantic are said in the one plain style of this package: found, expected, and the path.
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

from vibro_cli.errors import similar
from vibro_cli.scenario.base import Table
from vibro_cli.scenario.problems import Fault, KeyPath, listing, shown, suggestion
from vibro_cli.scenario.quantities import Kind
from vibro_cli.systems import system_named

Model = type[Table]


def _models_in(annotation: Any) -> Iterator[Model]:
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for part in get_args(annotation):
        yield from _models_in(part)


def model_at(path: KeyPath, root: Model) -> Model | None:
    """Return the model of the table at a path, or None where the path leads to no table.

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
    """Return the field of the key that a path ends with, or of the list whose entry it leads to."""
    while path and isinstance(path[-1], int):
        path = path[:-1]
    model = model_at(path[:-1], root) if path else None
    return None if model is None else model.model_fields.get(str(path[-1]))


def kind_at(path: KeyPath, root: Model) -> Kind | None:
    """Return the kind of the one value at a path; None where a table or a list is, or nothing."""
    field = field_at(path, root)
    if field is None:
        return None
    found = _kinds_within(field.annotation) if isinstance(path[-1], int) else field.metadata
    return next((kind for kind in found if isinstance(kind, Kind)), None)


def _kinds_within(annotation: Any) -> Iterator[Any]:
    """What the annotations of a list's entries, and of theirs, say."""
    for part in get_args(annotation):
        yield from getattr(part, "__metadata__", ())
        yield from _kinds_within(part)


def unit_at(path: KeyPath, root: Model) -> str:
    """Return the unit of the number at a path, an empty text where it has none."""
    kind = kind_at(path, root)
    return "" if kind is None else kind.unit


# Garbage that is collected while Python 3.11 parses may let another thread in, whose parsing spoils
# this one's count of levels (SystemError).
_PARSING = RLock()


@cache
def descriptions(model: Model) -> Mapping[str, str]:
    """Return what the text below each field of a model says."""
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
    """Return the first sentence that describes a field, or an empty text."""
    model, key = model_at(path[:-1], root), path[-1]
    if model is None or not isinstance(key, str) or key not in model.model_fields:
        return ""
    words = " ".join(descriptions(model).get(key, "").split())
    return words.split("; ")[0].rstrip(".")


@lru_cache(maxsize=8)
def _homes(root: Model) -> dict[str, list[str]]:
    """Return for each key the tables it belongs to."""
    homes: dict[str, list[str]] = {}
    for table, model in tables(root, ""):
        for key in model.model_fields:
            homes.setdefault(key, []).append(table)
    return homes


def tables(model: Model, path: str) -> Iterator[tuple[str, Model]]:
    """Return every table of a scenario by its path, a list's entries without their number."""
    yield path, model
    for key, field in model.model_fields.items():
        for below in _models_in(field.annotation):
            yield from tables(below, f"{path}.{key}" if path else key)


def known_keys(table: KeyPath, root: Model) -> list[str]:
    """Return the keys a table may have."""
    model = model_at(table, root)
    return [] if model is None else list(model.model_fields)


def hint(table: KeyPath, key: str, root: Model) -> str:
    """Return the suggestion for an unknown key: a similar one, or the table it belongs to."""
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
    """Return the faults of a scenario, each once; a mistyped key is not missing as well."""
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
    # tags of unions, such as "<wall>", are no part of the path; an unknown key may look like one
    loc = tuple(part for part in given if not str(part).startswith("<"))
    if kind == "extra_forbidden":
        loc = (*(part for part in given[:-1] if not str(part).startswith("<")), given[-1])
    if kind == "vibro":
        return Fault(loc, context["found"], context["expected"])
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
    """Return the fault of a key that no table has, with a suggestion."""
    table, key = loc[:-1], str(loc[-1])
    known = known_keys(table, root)
    expected = f"{listing(known)}{hint(table, key, root)}"
    return Fault(loc, f"the unknown key {shown(key)}", expected, on_key=True)


def settings(root: Model, values: Mapping[str, Any], path: KeyPath = ()) -> str:
    """Return settings of the table at a path on one line, with units, inner ones in parentheses."""
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
    """Return a unit as it is written in words: m/s² for m/s^2."""
    return unit.replace("^2", "²").replace("^3", "³")


DIALECT = "https://json-schema.org/draft/2020-12/schema"


# A JSON file may name its schema, for editors; not among the keys, as it says nothing of the scene.
SCHEMA_KEY: dict[str, Any] = {"patternProperties": {r"^\$schema$": {"type": "string"}}}


def identifier(name: str) -> str:
    """Return the `$id` of a schema of this name."""
    return f"urn:vibro:schema:{name}"


def json_schema(system: str = "trace") -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a system's scenarios as plain data."""
    schema = schema_of(system_named(system).model)
    for key in ("name", "collision"):  # their default depends on the file and on its bodies
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
    """Return the schema of a model and those below it, with the descriptions of their fields."""
    schema = root.model_json_schema()
    for _, model in tables(root, ""):
        part = schema if model is root else schema["$defs"][model.__name__]
        for key, words in descriptions(model).items():
            if key in part["properties"]:  # `system` is no key of the trace's own
                described = {**part["properties"][key], "description": words}
                part["properties"][key] = dict(sorted(described.items()))
    return schema


def _cleaned(value: Any) -> Any:
    """Return a schema without null, which no key may be, and without the titles of fields."""
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
    """Yield the key paths of a JSON Schema with their nodes, and whether they are required.

    `[i]` stands for any entry of a list, which has a path of its own.
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
