"""Errors of pydantic in the one plain style of this package: found, expected, and the path."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from vibro_cli.scenario import fields
from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import Fault, KeyPath, listing, shown, similar

_EXPECTED = {
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
    "tuple_type": "a list",
    "union_tag_not_found": '"stop" or a table {wall = ...}',
    "union_tag_invalid": '"stop" or a table {wall = ...}',
    "too_short": "a list of at least one",
}


def faults(error: ValidationError, root: type[BaseModel]) -> list[Fault]:
    """Return the faults of a scenario, each once; a mistyped key is not missing as well.

    `root` is the model of the scenario.
    """
    details = error.errors(include_url=False)
    found = dict.fromkeys(_fault(item, root) for item in details)
    mistyped = {
        (*loc[:-1], similar(str(loc[-1]), fields.known_keys(loc[:-1], root)))
        for loc in (item["loc"] for item in details if item["type"] == "extra_forbidden")
    }
    return [fault for fault in found if fault.found != "nothing" or fault.loc not in mistyped]


def _fault(details: ErrorDetails, root: type[BaseModel]) -> Fault:
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


def _needed(loc: KeyPath, root: type[BaseModel]) -> str:
    words = fields.description(loc, root)
    key = f'the key "{loc[-1]}"'
    return f"{key}: {words[:1].lower()}{words[1:]}" if words else key


def unknown_key(loc: KeyPath, root: type[BaseModel] = Scenario) -> Fault:
    """Return the fault of a key that no table has, with a suggestion."""
    table, key = loc[:-1], str(loc[-1])
    known = fields.known_keys(table, root)
    expected = f"{listing(known)}{fields.hint(table, key, root)}"
    return Fault(loc, f"the unknown key {shown(key)}", expected, on_key=True)
