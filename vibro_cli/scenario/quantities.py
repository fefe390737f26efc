"""The values of a scenario: numbers with a dimension and bounds, counts and words.

Each kind is an annotation of a pydantic field (`Annotated[float, LENGTH]`) that validates the
value, says what it expected, and describes itself in the JSON Schema. The same objects read values
leniently for the rules that compare several fields.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from vibro_cli.scenario.problems import listing, shown, suggestion

EXAMPLES = {
    "length": "m, cm, mm, in",
    "mass": "kg, g, t",
    "time": "s, ms, min, h",
    "angle": "rad, deg, turn",
    "angular rate": "rad/s, deg/s, rpm",
    "speed": "m/s, cm/s, km/h",
    "acceleration": "m/s^2, g0",
    "density": "kg/m^3, g/cm^3",
    "stiffness": "N/m, kN/m",
}
"""Units to name in an error, for each dimension."""


def fault(found: str, expected: str) -> PydanticCustomError:
    """Return the error a field raises, with what was found and what was expected."""
    context = {"found": found, "expected": expected}
    return PydanticCustomError("vibro", "found {found}, expected {expected}", context)


class Kind:
    """A kind of value: `read` turns what the file holds into the value, or raises."""

    def read(self, value: object) -> Any:
        """Return the value, or raise a `PydanticCustomError` made by `fault`."""
        raise NotImplementedError

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema of the value."""
        raise NotImplementedError

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return self.schema()


@dataclass(frozen=True)
class Quantity(Kind):
    """A finite real number, with a dimension (then also a text with its unit) and bounds.

    `dimension` is a key of `units.DIMENSIONS` or empty; `above` is an open lower bound, `at_least`
    and `at_most` are closed ones; `bounds` says them in other words.
    """

    dimension: str = ""
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    bounds: str = ""

    def read(self, value: object) -> float:
        """Return the SI value as a double."""
        number = self._number(value)
        if not math.isfinite(number):
            raise fault(self._found(value, number), f"a finite number{self._bounds()}")
        if (
            (self.above is not None and number <= self.above)
            or (self.at_least is not None and number < self.at_least)
            or (self.at_most is not None and number > self.at_most)
        ):
            raise fault(self._found(value, number), f"a number{self._bounds()}")
        return number

    def read_or_none(self, value: object) -> float | None:
        """Return the SI value, or None where there is none: the field itself reports that."""
        try:
            return self.read(value)
        except PydanticCustomError:
            return None

    def _number(self, value: object) -> float:
        if isinstance(value, str) and self.dimension:
            return self._with_unit(value)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            expected = f"a number{self._bounds()}"
            if self.dimension:
                expected += f" or a text with its unit ({EXAMPLES[self.dimension]}, ...)"
            raise fault(shown(value), expected)
        try:
            return float(value)
        except OverflowError:
            return math.inf if value > 0 else -math.inf

    def _with_unit(self, text: str) -> float:
        from vibro_cli.scenario.units import UnitError, to_si

        article = "an" if self.dimension[0] in "aeiou" else "a"
        expected = f"{article} {self.dimension} ({EXAMPLES[self.dimension]}, ...)"
        try:
            return to_si(text, self.dimension)
        except UnitError as error:
            found = f"{error.found} in {shown(text)}" if error.found else shown(text)
            raise fault(found, expected + error.hint) from None

    def _found(self, value: object, number: float) -> str:
        if isinstance(value, str):
            return f"{shown(value)} ({number!r})"
        return shown(value)

    def _bounds(self) -> str:
        if self.bounds:
            return f" {self.bounds}"
        if self.above is not None:
            return f" greater than {self.above:g}"
        if self.at_least is not None and self.at_most is not None:
            return f" from {self.at_least:g} to {self.at_most:g}"
        return "" if self.at_least is None else f" of at least {self.at_least:g}"

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema: a number, or for a dimension also a text with its unit."""
        number: dict[str, Any] = {"type": "number"}
        bounds = (
            ("exclusiveMinimum", self.above),
            ("minimum", self.at_least),
            ("maximum", self.at_most),
        )
        number.update({word: bound for word, bound in bounds if bound is not None})
        if not self.dimension:
            return number
        example = EXAMPLES[self.dimension].split(", ")
        text = {
            "type": "string",
            "pattern": r"^\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\s*[^\s0-9].*$",
            "description": f"a number with a unit of {self.dimension}: {', '.join(example)}, ...",
        }
        return {"anyOf": [number, text]}


@dataclass(frozen=True)
class Count(Kind):
    """A whole number, at least 1 and below 2^63."""

    def read(self, value: object) -> int:
        """Return the whole number."""
        if isinstance(value, int) and not isinstance(value, bool) and 1 <= value < 2**63:
            return value
        raise fault(shown(value), "a whole number of at least 1")

    def read_or_none(self, value: object) -> int | None:
        """Return the whole number, or None where there is none."""
        try:
            return self.read(value)
        except PydanticCustomError:
            return None

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema: an integer from 1."""
        return {"type": "integer", "minimum": 1}


@dataclass(frozen=True)
class Word(Kind):
    """One of a few words."""

    words: Sequence[str]

    def read(self, value: object) -> str:
        """Return the word."""
        if isinstance(value, str) and value in self.words:
            return value
        hint = suggestion(value, self.words) if isinstance(value, str) else ""
        raise fault(shown(value), listing(f'"{word}"' for word in self.words) + hint)

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema: a string of the list."""
        if len(self.words) == 1:
            return {"const": self.words[0], "type": "string"}
        return {"enum": list(self.words), "type": "string"}


@dataclass(frozen=True)
class Flag(Kind):
    """True or false."""

    def read(self, value: object) -> bool:
        """Return the truth value."""
        if isinstance(value, bool):
            return value
        raise fault(shown(value), "true or false")

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema: a boolean."""
        return {"type": "boolean"}


@dataclass(frozen=True)
class Name(Kind):
    """A name that can also be the name of a folder."""

    def read(self, value: object) -> str:
        """Return the name."""
        expected = "a name of 1 to 100 printable characters without / and \\"
        if not isinstance(value, str):
            raise fault(shown(value), expected)
        usable = 1 <= len(value) <= 100 and value.isprintable() and not set(value) & set("/\\")
        if usable and value.strip() == value and value not in (".", ".."):
            return value
        raise fault(shown(value), expected)

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema: a string without slashes."""
        return {"type": "string", "minLength": 1, "maxLength": 100, "pattern": r"^[^/\\]+$"}


POSITION = Quantity("length")
LENGTH = Quantity("length", above=0)
RADIUS = Quantity("length", at_least=0, bounds="greater than 0 (0 only for a lone particle)")
MASS = Quantity("mass", above=0)
DENSITY = Quantity("density", above=0)
STIFFNESS = Quantity("stiffness", above=0)
TIME = Quantity("time", above=0)
INSTANT = Quantity("time", at_least=0)
ANGLE = Quantity("angle")
ANGULAR_RATE = Quantity("angular rate")
SPEED = Quantity("speed")
GRAVITY = Quantity("acceleration", above=0)
RATIO = Quantity(at_least=0)
RESTITUTION = Quantity(at_least=0, at_most=1)
COUNT = Count()
FLAG = Flag()
NAME = Name()
