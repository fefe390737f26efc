"""The scalars of a scenario that an axis may go through: their kinds, units and types."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, get_args

from pydantic import BaseModel

from vibro_cli.scenario import Scenario, fields
from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.problems import Fault, KeyPath, path_text
from vibro_cli.scenario.translate import unknown_key

UNITS = {
    "": "",
    "length": "m",
    "mass": "kg",
    "time": "s",
    "angle": "rad",
    "angular rate": "rad/s",
    "speed": "m/s",
    "acceleration": "m/s^2",
    "density": "kg/m^3",
    "stiffness": "N/m",
}
# What a grid's tables do not depend on.
_WITHOUT_EFFECT = ("name", "output")

Model = type[BaseModel]


class NotAnAxis(Exception):
    """A path that no axis can go through, as a fault without a place."""

    def __init__(self, fault: Fault) -> None:
        super().__init__(fault)
        self.fault = fault


def kind_of(path: KeyPath, root: Model = Scenario) -> kinds.Kind:
    """Return the kind of the scalar at a path of scenarios with the model `root`.

    Raises
    ------
    NotAnAxis
        If a scenario has nothing there, or nothing that is one value.
    """
    if path[0] in _WITHOUT_EFFECT:
        expected = "a value that the tables of a grid depend on"
        raise NotAnAxis(Fault(path, path_text(path), expected))
    if path == ("system",):
        expected = "a value of the scenario: those of a grid are of one system"
        raise NotAnAxis(Fault(path, path_text(path), expected))
    if path[:2] == ("collision", "k") and len(path) in (2, 3):
        return kinds.RESTITUTION
    entries = next((n for n, part in enumerate(reversed(path)) if isinstance(part, str)), 0)
    table, key = path[: len(path) - entries - 1], path[len(path) - entries - 1]
    model = fields.model_at(table, root)
    if model is None or not isinstance(key, str) or key not in model.model_fields:
        raise NotAnAxis(_unknown(path, model, root))
    field = model.model_fields[key]
    for part in _kinds_within(field.annotation) if entries else field.metadata:
        if isinstance(part, kinds.Kind):
            return part
    expected = "one value: a number, a word, true or false"
    raise NotAnAxis(Fault(path, f"{path_text(path)} as a whole", expected))


def _kinds_within(annotation: Any) -> Iterator[Any]:
    """What the annotations of a list's entries, and of theirs, say."""
    for part in get_args(annotation):
        yield from getattr(part, "__metadata__", ())
        yield from _kinds_within(part)


def _unknown(path: KeyPath, model: Model | None, root: Model) -> Fault:
    if model is None or isinstance(path[-1], int):
        return Fault(path, path_text(path), "a value of a scenario, such as balls[1].angle")
    return unknown_key(path, root)


def unit_of(kind: kinds.Kind) -> str:
    """Return the unit in which values of a kind stand in tables, "" for plain numbers."""
    return UNITS[kind.dimension] if isinstance(kind, kinds.Quantity) else ""


def type_of(kind: kinds.Kind) -> Any:
    """Return the type of the column for values of a kind, as ``storage.schema`` names it."""
    if isinstance(kind, kinds.Quantity):
        return "float64"
    if isinstance(kind, kinds.Count):
        return "int64"
    return "bool" if isinstance(kind, kinds.Flag) else "string"


def read_number(kind: kinds.Kind, value: Any) -> Any:
    """Return one value of an axis in SI units; what the scenario refuses may still be one.

    Bounds are left to the scenario: a value beyond them makes an invalid point, not a wrong axis.

    Raises
    ------
    PydanticCustomError
        If the value is not of this kind at all.
    """
    if isinstance(kind, kinds.Quantity):
        return kinds.Quantity(kind.dimension).read(value)
    if isinstance(kind, kinds.Count) and isinstance(value, int) and not isinstance(value, bool):
        return value
    return kind.read(value)
