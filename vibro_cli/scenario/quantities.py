"""Kinds of values in a scenario: numbers with a dimension and bounds, counts and words.

Each kind annotates a pydantic field (`Annotated[float, LENGTH]`). It validates the value, reports
what it expected, and describes itself in the JSON Schema. Rules that compare several fields use the
same objects to read values leniently.

A text with a unit ("60 deg", "7.8 g/cm^3") becomes an SI number that is rounded once. The unit
libraries (pint, astropy.units, unyt) multiply by a rounded factor, hence round twice, use pi as a
double even with fractions, and take 330-380 ms to import. A scenario needs some thirty units and
one rounding, so this module has a table of exact factors: the value, the factors and pi (120
digits) are fractions, and only the result becomes a double.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from vibro_cli.errors import listing
from vibro_cli.scenario.problems import shown, suggestion

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
    "energy": "J, mJ, kJ",
}
"""Units to name in errors, by dimension, the SI unit first."""


def fault(found: str, expected: str, on_key: bool = False) -> PydanticCustomError:
    """Return the error that a field raises, with what was found and what was expected."""
    context = {"found": found, "expected": expected, "on_key": on_key}
    return PydanticCustomError("vibro", "found {found}, expected {expected}", context)


class Kind:
    """A kind of value: `read` converts the content of a file to the value, or raises."""

    @property
    def unit(self) -> str:
        """SI unit of its numbers; empty for dimensionless numbers and other values."""
        return ""

    def read(self, value: object) -> Any:
        """Return the value, or raise a `PydanticCustomError` made by `fault`."""
        raise NotImplementedError

    def read_or_none(self, value: object) -> Any:
        """Return the value, or None if it is invalid, which the field itself reports."""
        try:
            return self.read(value)
        except PydanticCustomError:
            return None

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


SI = {dimension: units.partition(",")[0] for dimension, units in EXAMPLES.items()}
"""SI units by dimension."""


@dataclass(frozen=True)
class Quantity(Kind):
    """A finite real number with bounds, and a dimension if it may be given as text with a unit.

    `dimension` is a key of `DIMENSIONS` or empty. `above` is an open lower bound, `at_least` and
    `at_most` are closed bounds; `bounds` replaces their wording. Numbers other than 0 must be
    `within` an interval in which products and quotients of the mechanics cannot over- or underflow.
    """

    dimension: str = ""
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    bounds: str = ""
    within: tuple[float, float] = (-math.inf, math.inf)

    @property
    def unit(self) -> str:
        """SI unit of its numbers."""
        return SI[self.dimension] if self.dimension else ""

    def read(self, value: object) -> float:
        """Return the SI value as a double."""
        number = self._number(value)
        if not math.isfinite(number):
            raise fault(self._found(value, number), f"a finite number{self._bounds()}")
        if not self._in_bounds(number):
            raise fault(self._found(value, number), f"a number{self._bounds()}")
        if not self._is_computable(number):
            low, high = self.within
            expected = f"{self._named()} from {low:g} to {high:g} {self.unit}"
            raise fault(self._found(value, number), expected)
        return number

    def allows(self, number: Any) -> Any:
        """Return whether an SI value is finite and within the bounds, elementwise for arrays."""
        return self._in_bounds(number) & self._is_computable(number)

    def _in_bounds(self, number: Any) -> Any:
        allowed = abs(number) < math.inf
        if self.above is not None:
            allowed = allowed & (number > self.above)
        if self.at_least is not None:
            allowed = allowed & (number >= self.at_least)
        if self.at_most is not None:
            allowed = allowed & (number <= self.at_most)
        return allowed

    def _is_computable(self, number: Any) -> Any:
        low, high = self.within
        return (number == 0.0) | ((number >= low) & (number <= high))

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
        expected = f"{self._named()} ({EXAMPLES[self.dimension]}, ...)"
        try:
            return to_si(text, self.dimension)
        except UnitError as error:
            found = f"{error.found} in {shown(text)}" if error.found else shown(text)
            raise fault(found, expected + error.hint) from None

    def _named(self) -> str:
        return f"{'an' if self.dimension[0] in 'aeiou' else 'a'} {self.dimension}"

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
        """Return the JSON Schema: a number or, with a dimension, also a text with a unit."""
        number: dict[str, Any] = {"type": "number"}
        low, high = self.within
        bounds = {"exclusiveMinimum": self.above, "minimum": self.at_least}
        if self.at_least is None and (self.above is None or low > self.above):
            bounds = {"minimum": low}
        bounds["maximum"] = high if self.at_most is None else self.at_most
        given = {word: bound for word, bound in bounds.items() if bound is not None}
        number |= {word: bound for word, bound in given.items() if math.isfinite(bound)}
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
    """An integer below 2^63, from `least` up to `most`, if given."""

    least: int = 1
    most: int | None = None

    def read(self, value: object) -> int:
        """Return the integer."""
        if isinstance(value, int) and not isinstance(value, bool) and self.allows(value):
            return value
        bounds = f"of at least {self.least}"
        if self.most is not None:
            bounds = f"from {self.least} to {self.most}"
        elif isinstance(value, (int, float)) and value >= 2**63:
            bounds = "below 2^63"
        if isinstance(value, float) and value.is_integer() and self.allows(int(value)):
            bounds += f", written {int(value)}"  # 1e6 is a number with a point in TOML and YAML
        raise fault(shown(value), f"a whole number {bounds}")

    def allows(self, number: Any) -> Any:
        """Return whether an integer is within the bounds, elementwise for arrays."""
        return (number >= self.least) & (
            number < 2**63 if self.most is None else number <= self.most
        )

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema: an integer with its bounds."""
        bounds = {"minimum": self.least, "maximum": self.most}
        return {"type": "integer", **{word: n for word, n in bounds.items() if n is not None}}


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
        """Return the JSON Schema: one of the words."""
        if len(self.words) == 1:
            return {"const": self.words[0], "type": "string"}
        return {"enum": list(self.words), "type": "string"}


@dataclass(frozen=True)
class Text(Kind):
    """Any text; `meaning` names it in errors."""

    meaning: str

    def read(self, value: object) -> str:
        """Return the text."""
        if isinstance(value, str):
            return value
        raise fault(shown(value), self.meaning)

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema: a string."""
        return {"type": "string"}


@dataclass(frozen=True)
class Dictionary(Kind):
    """Values by name; `meaning` names them in errors."""

    meaning: str

    def read(self, value: object) -> Mapping[str, Any]:
        """Return the dictionary; its content is not checked."""
        if isinstance(value, Mapping):
            return value
        raise fault(shown(value), f"a dictionary of {self.meaning}")


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
        if not usable or value.strip() != value or value in (".", ".."):
            raise fault(shown(value), expected)
        # File systems allow names of 255 bytes, and temporary files have longer names.
        if len(value.encode()) > 200:
            raise fault(shown(value), "a name of at most 200 bytes in UTF-8")
        return value

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema: a string without slashes."""
        return {"type": "string", "minLength": 1, "maxLength": 100, "pattern": r"^[^/\\]+$"}


_SIZES = (1e-30, 1e30)
_NUMBERS = (-1e30, 1e30)
_TIMES = (0.0, 1e300)

POSITION = Quantity("length", within=_NUMBERS)
LENGTH = Quantity("length", above=0, within=_SIZES)
RADIUS = Quantity(
    "length", at_least=0, bounds="greater than 0 (0 only for a lone particle)", within=_SIZES
)
MASS = Quantity("mass", above=0)
DENSITY = Quantity("density", above=0)
STIFFNESS = Quantity("stiffness", above=0, within=_SIZES)
TIME = Quantity("time", above=0, within=_TIMES)
INSTANT = Quantity("time", at_least=0, within=_TIMES)
ANGLE = Quantity("angle")
SLOPE = Quantity("angle", within=(-1e3, 1e3))
ANGULAR_RATE = Quantity("angular rate", within=_NUMBERS)
SPEED = Quantity("speed", within=_NUMBERS)
GRAVITY = Quantity("acceleration", above=0, within=_SIZES)
RATIO = Quantity(at_least=0)
RESTITUTION = Quantity(at_least=0, at_most=1)
COUNT = Count()
FLAG = Flag()
NAME = Name()


PI = Fraction(
    "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899"
    "8628034825342117067982148086513282306647"
)
"""pi to 120 digits, which rounds every value of at most 60 digits to the right double."""

Dimension = tuple[int, int, int, int]
"""Powers of length, mass, time and angle."""

_LENGTH: Dimension = (1, 0, 0, 0)
_MASS: Dimension = (0, 1, 0, 0)
_TIME: Dimension = (0, 0, 1, 0)
_ANGLE: Dimension = (0, 0, 0, 1)
_RATE: Dimension = (0, 0, -1, 1)


@dataclass(frozen=True)
class Unit:
    """A unit: its exact factor to SI (angles in radians) and its dimension."""

    factor: Fraction
    dimension: Dimension


def _units(dimension: Dimension, factors: dict[str, str | Fraction]) -> dict[str, Unit]:
    return {
        name: Unit(Fraction(factor), dimension)
        for names, factor in factors.items()
        for name in names.split()
    }


UNITS: dict[str, Unit] = {
    **_units(
        _LENGTH,
        {
            "m metre meter metres meters": "1",
            "km": "1000",
            "dm": "0.1",
            "cm": "0.01",
            "mm": "0.001",
            "um µm μm": "1e-6",
            "nm": "1e-9",
            "in inch inches": "0.0254",
            "ft foot feet": "0.3048",
        },
    ),
    **_units((3, 0, 0, 0), {"l L litre liter": "0.001", "ml mL": "1e-6"}),
    **_units(
        _MASS,
        {
            "kg kilogram kilograms": "1",
            "g gram grams": "0.001",
            "mg": "1e-6",
            "t tonne tonnes": "1000",
            "lb": "0.45359237",
        },
    ),
    **_units(
        _TIME,
        {
            "s sec second seconds": "1",
            "ms": "0.001",
            "us µs μs": "1e-6",
            "ns": "1e-9",
            "min minute minutes": "60",
            "h hour hours": "3600",
        },
    ),
    **_units(
        _ANGLE,
        {
            "rad radian radians": "1",
            "mrad": "0.001",
            "deg degree degrees °": PI / 180,
            "arcmin": PI / 10800,
            "arcsec": PI / 648000,
            "gon": PI / 200,
            "turn turns rev": 2 * PI,
        },
    ),
    **_units(_RATE, {"rpm": PI / 30}),
    **_units((1, 1, -2, 0), {"N": "1", "kN": "1000"}),
    **_units((2, 1, -2, 0), {"J": "1", "mJ": "0.001", "kJ": "1000"}),
    **_units((1, 0, -2, 0), {"g0 gn": "9.80665"}),
}
"""All known units."""

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.ASCII)
_FACTOR = re.compile(
    r"\s*(?P<over>[*/·⋅]?)\s*(?P<unit>[A-Za-zµμ]+0?|°)\s*(?:(?:\^|\*\*)?\s*"
    r"(?P<power>[+-]?\d{1,2})|(?P<raised>[⁺⁻]?[⁰¹²³⁴⁵⁶⁷⁸⁹]{1,2}))?"
)
_RAISED = str.maketrans("⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "+-0123456789")
_PRINTED_MINUS = "\N{MINUS SIGN}"
_MOST_DIGITS = 60
_LARGEST_EXPONENT = 400


class UnitError(ValueError):
    """A text that is not a value of the required dimension.

    `found` is the wrong part, empty if it is the whole text; `hint` suggests another unit.
    """

    def __init__(self, found: str = "", hint: str = "") -> None:
        super().__init__(found)
        self.found = found
        self.hint = hint


def exact(text: str, dimension: str) -> Fraction:
    """Return the SI value of a number with a unit, such as "60 deg", "7.8 g/cm^3", "9.81 m s^-2".

    Angles are in radians. The value is exact except for pi, which has 120 digits. Raises
    `UnitError` if the text is not a number with a known unit of this dimension (a key of
    `DIMENSIONS`).
    """
    match = _QUANTITY.fullmatch(text) if len(text) <= 200 else None
    if match is None and _PRINTED_MINUS in text:  # copied from a paper or report
        raise UnitError("the sign − (U+2212)", " with - as minus")
    if match is None:
        raise UnitError
    number, unit_text = match.groups()
    if not unit_text:
        raise UnitError("no unit")
    if unit_text.startswith(","):  # a decimal comma; no unit begins with one
        raise UnitError("a comma", " with . as decimal point")
    unit = unit_of(unit_text)
    if unit.dimension != DIMENSIONS[dimension]:
        raise UnitError
    return _decimal(number) * unit.factor


@lru_cache(maxsize=1024)  # the points of a grid share nearly all texts
def to_si(text: str, dimension: str) -> float:
    """Return the SI value of a text with a unit, rounded once to the nearest double.

    Parameters and errors as for `exact`; a value too large for a double raises `UnitError`.
    """
    try:
        return float(exact(text, dimension))
    except OverflowError:
        raise UnitError("a number too large") from None


def _decimal(number: str) -> Fraction:
    mantissa, _, exponent = number.lower().partition("e")
    if len(mantissa) > _MOST_DIGITS:
        raise UnitError(f"more than {_MOST_DIGITS} digits")
    if exponent and (len(exponent) > 5 or abs(int(exponent)) > _LARGEST_EXPONENT):
        raise UnitError(f"an exponent beyond {_LARGEST_EXPONENT}")
    return Fraction(number)


@lru_cache(maxsize=256)
def unit_of(text: str) -> Unit:
    """Return the unit given by a text: factors with powers, joined by spaces, `*` or `/`.

    `/` divides by the next factor only: `kg/m/s` and `kg m^-1 s^-1` are the same.
    """
    factor, dimension = Fraction(1), (0, 0, 0, 0)
    position = 0
    while position < len(text):
        match = _FACTOR.match(text, position)
        if match is None or (position == 0 and match["over"]):
            raise UnitError("an unknown unit")
        name = match["unit"]
        if name not in UNITS:
            raise UnitError(f'the unknown unit "{name[:20]}"', suggestion(name, UNITS))
        power = int((match["power"] or match["raised"] or "1").translate(_RAISED))
        if abs(power) > 9:
            raise UnitError("an unknown unit")
        power = -power if match["over"] == "/" else power
        factor *= UNITS[name].factor ** power
        length, mass, time, angle = (
            before + power * added
            for before, added in zip(dimension, UNITS[name].dimension, strict=True)
        )
        dimension = length, mass, time, angle
        position = match.end()
    return Unit(factor, dimension)


DIMENSIONS = {name: unit_of(unit).dimension for name, unit in SI.items()}
"""The dimensions that values of a scenario can have, and that of an orbit's energy."""
