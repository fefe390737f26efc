"""The JSON Schema of scenario files, for editors and other programs."""

from __future__ import annotations

from typing import Any

from vibro_cli.scenario.base import ScenarioTable, model_named
from vibro_cli.scenario.fields import descriptions, tables
from vibro_cli.scenario.rules import AXIS, KIND, MASS, MOTION, SAMPLES, START

DIALECT = "https://json-schema.org/draft/2020-12/schema"


# A JSON file may name its schema, for editors; not among the keys, as it says nothing of the scene.
SCHEMA_KEY: dict[str, Any] = {"patternProperties": {r"^\$schema$": {"type": "string"}}}


def identifier(name: str) -> str:
    """Return the `$id` of a schema of this name."""
    return f"urn:vibro:schema:{name}"


def exactly_one(*keys: str) -> dict[str, Any]:
    """Return the rule that a table has one of these keys, and no other of them."""
    return {"oneOf": [{"required": [key]} for key in keys]}


def _at_most_one(*keys: str) -> dict[str, Any]:
    pairs = [[a, b] for i, a in enumerate(keys) for b in keys[i + 1 :]]
    return {"not": {"anyOf": [{"required": pair} for pair in pairs]}}


def _shape(words: list[str], needed: list[str], unfit: list[str]) -> dict[str, Any]:
    then = {"required": needed, "not": {"anyOf": [{"required": [key]} for key in unfit]}}
    return {"if": {"properties": {"shape": {"enum": words}}}, "then": then}


_BODY = [
    exactly_one(*MASS),
    _at_most_one(*KIND),
    _at_most_one("inertia_ratio", "density"),
]
_RULES: dict[str, list[dict[str, Any]]] = {
    "Arc": [
        _shape(["line"], ["length"], ["radius", "end_slope"]),
        _shape(["valley", "hump"], ["radius", "end_slope"], ["length"]),
    ],
    "Ball": [
        *_BODY,
        exactly_one(*START),
        _at_most_one(*MOTION),
    ],
    "Turning": [exactly_one(*AXIS)],
    "Stop": [{"anyOf": [{"required": ["time"]}, {"required": ["collisions"]}]}],
    "Output": [_at_most_one(*SAMPLES)],
    "Sampling": [_at_most_one(*SAMPLES)],
    "TableBall": _BODY,
    "TableStop": [
        {"anyOf": [{"required": [key]} for key in ("time", "collisions", "bounces")]},
    ],
    "SpringBall": [
        *_BODY,
        exactly_one("position", "touching"),
        _at_most_one("speed", "omega"),
    ],
}
"""The rules between the keys of one table, as far as JSON Schema can say them."""


def json_schema(system: str = "trace") -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a system's scenarios as plain data."""
    schema: dict[str, Any] = _cleaned(_described(model_named(system)))
    for table, rules in _RULES.items():
        if table in schema["$defs"]:
            schema["$defs"][table]["allOf"] = rules
    for table, key in (("", "name"), ("", "collision"), ("Collision", "k")):
        part = schema["$defs"].get(table) if table else schema
        if part is not None:
            del part["properties"][key]["default"]  # these depend on the file and on its bodies
    head = {"$schema": DIALECT, "$id": identifier(system)}
    return {**head, **schema, **SCHEMA_KEY, "title": "vibro scenario"}


def _described(root: type[ScenarioTable]) -> dict[str, Any]:
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
