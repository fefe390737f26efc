"""The JSON Schema of grid files, for editors and other programs."""

from __future__ import annotations

from typing import Any

from vibro_cli.grids.document import impact_columns_of
from vibro_cli.grids.points import MODES, SAMPLED
from vibro_cli.scenario.json_schema import DIALECT, SCHEMA_KEY, exactly_one, identifier, json_schema

_END = {"type": ["number", "string"]}
_COUNT = {"type": "integer", "minimum": 1}


def _list_of(*items: dict[str, Any], least: int | None = None) -> dict[str, Any]:
    fewest = len(items) if least is None else least
    return {"type": "array", "prefixItems": list(items), "minItems": fewest, "items": False}


_SPACED = _list_of(_END, _END, _COUNT)
_AXIS: dict[str, dict[str, Any]] = {
    "path": {
        "description": "The scalar of the scenario that the axis changes, such as balls[1].angle; "
        "counted from 1.",
        "type": "string",
    },
    "paths": {
        "description": "Or several scalars, which go through their values together.",
        "type": "array",
        "items": {"type": "string"},
        "minItems": 1,
    },
    "values": {
        "description": "The values, numbers or words; of several paths one for all, or a list "
        "with one for each.",
        "type": "array",
        "minItems": 1,
    },
    "linspace": {
        "description": "[low, high, count]: equal steps, both ends included; the ends may carry a "
        "unit.",
        **_SPACED,
    },
    "logspace": {
        "description": "[low, high, count]: equal ratios, both ends included.",
        **_SPACED,
    },
    "uniform": {
        "description": "[low, high]: the interval that a mode with n draws from; "
        "[low, high, count]: random values.",
        **_list_of(_END, _END, _COUNT, least=2),
    },
    "table": {
        "description": "A .parquet or .csv file, whose columns are named by paths: a row is one "
        "value of the axis; with path or paths only those columns.",
        "type": "string",
    },
}
_KEEP: dict[str, dict[str, Any]] = {
    "collisions": {
        "description": "Whether every impact is kept, beside the summaries.",
        "type": "boolean",
        "default": False,
    },
    "columns": {
        "description": "Columns of the tables of impacts; all of them if not given.",
        "type": "array",
        "minItems": 1,
    },
}
_GENERATORS = ("values", "linspace", "logspace", "uniform", "table")


def grid_schema(system: str = "trace") -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of grids over a system's scenarios as plain data."""
    within = _incomplete(json_schema(system))
    tables = within.pop("$defs")
    del within["$schema"], within["$id"], within["patternProperties"]
    names = [column.name for column in impact_columns_of(system)]
    keep = {**_KEEP, "columns": {**_KEEP["columns"], "items": {"enum": names}}}
    return {
        "$schema": DIALECT,
        "$id": identifier(f"grid-{system}"),
        "title": "vibro grid",
        "description": "A scenario, by reference or inline, and the axes that change it.",
        "type": "object",
        "additionalProperties": False,
        "properties": _properties(),
        **SCHEMA_KEY,
        "required": ["axes"],
        "allOf": [exactly_one("base", "scenario"), _count_of_samples()],
        "$defs": {
            **tables,
            "Scenario": {**within, "description": "A scenario, not complete without the axes."},
            "Axis": _axis(),
            "Keep": _table("What is kept of each scenario beside its summary.", keep),
        },
    }


def _properties() -> dict[str, Any]:
    return {
        "name": {
            "description": "Name of the grid and of its folder; the file's stem if not given.",
            "type": "string",
        },
        "base": {
            "description": "File of the scenario that the axes change, from this file's folder.",
            "type": "string",
        },
        "scenario": {
            "description": "Or that scenario itself, inline; what the axes give may be left out.",
            "$ref": "#/$defs/Scenario",
        },
        "mode": {
            "description": "How the axes make points: product (each value with each, the last "
            "axis changing fastest), zip (one after the other), or a design of n points.",
            "enum": list(MODES),
            "default": MODES[0],
        },
        "n": {"description": "Number of points of a latin-hypercube or sobol design.", **_COUNT},
        "seed": {
            "description": "Seed of whatever is random.",
            "type": "integer",
            "minimum": 0,
            "default": 0,
        },
        "axes": {
            "description": "The axes, at least one.",
            "type": "array",
            "minItems": 1,
            "items": {"$ref": "#/$defs/Axis"},
        },
        "keep": {
            "description": "What is kept of each scenario beside its summary.",
            "$ref": "#/$defs/Keep",
        },
        "chunk_points": {
            "description": "Points of a part on the disk; as many as make a good file if not "
            "given.",
            **_COUNT,
        },
    }


def _table(description: str, properties: dict[str, Any]) -> dict[str, Any]:
    return {
        "description": description,
        "type": "object",
        "additionalProperties": False,
        "properties": properties,
    }


def _axis() -> dict[str, Any]:
    rules: list[dict[str, Any]] = [
        exactly_one(*_GENERATORS),
        {"not": {"required": ["path", "paths"]}},
        {"anyOf": [{"required": [key]} for key in ("path", "paths", "table")]},
    ]
    axis = _table("Some scalars of the scenario, and the values they go through.", _AXIS)
    return {**axis, "allOf": rules}


def _count_of_samples() -> dict[str, Any]:
    sampled = {"properties": {"mode": {"enum": list(SAMPLED)}}, "required": ["mode"]}
    return {"if": sampled, "then": {"required": ["n"]}, "else": {"not": {"required": ["n"]}}}


def _incomplete(value: Any) -> Any:
    """A schema of scenarios without the rules about what must be there."""
    if isinstance(value, list):
        return [_incomplete(item) for item in value]
    if not isinstance(value, dict):
        return value
    left = {key: item for key, item in value.items() if key not in ("required", "allOf")}
    return {key: _incomplete(item) for key, item in left.items()}
