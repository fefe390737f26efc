"""Exact conversion of a text with a unit ("60 deg", "7.8 g/cm^3") to an SI number, rounded once.

The unit libraries (pint, astropy.units, unyt) multiply by a rounded factor, hence round twice,
carry pi as a double even when they count in fractions, and cost 330-380 ms on import. A scenario
needs some thirty units and one rounding, so this module keeps a table of exact factors: the
value, the factors and pi (120 digits) are fractions, and only the result becomes a double.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from vibro_cli.scenario.problems import suggestion

PI = Fraction(
    "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899"
    "8628034825342117067982148086513282306647"
)
"""pi to 120 digits: with it no value of at most 60 digits is rounded to a wrong double."""

Dimension = tuple[int, int, int, int]
"""Powers of length, mass, time and angle."""

_LENGTH: Dimension = (1, 0, 0, 0)
_MASS: Dimension = (0, 1, 0, 0)
_TIME: Dimension = (0, 0, 1, 0)
_ANGLE: Dimension = (0, 0, 0, 1)
_RATE: Dimension = (0, 0, -1, 1)

DIMENSIONS: dict[str, Dimension] = {
    "length": _LENGTH,
    "mass": _MASS,
    "time": _TIME,
    "angle": _ANGLE,
    "angular rate": _RATE,
    "speed": (1, 0, -1, 0),
    "acceleration": (1, 0, -2, 0),
    "density": (-3, 1, 0, 0),
    "stiffness": (0, 1, -2, 0),
}
"""The dimensions a value of a scenario can have."""


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
    **_units(_MASS, {"kg": "1", "g": "0.001", "mg": "1e-6", "t tonne": "1000", "lb": "0.45359237"}),
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
    **_units(DIMENSIONS["acceleration"], {"g0 gn": "9.80665"}),
}
"""Every unit that is understood."""

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.ASCII)
_FACTOR = re.compile(
    r"\s*(?P<over>[*/·⋅]?)\s*(?P<unit>[A-Za-zµμ]+0?|°)\s*(?:(?:\^|\*\*)?\s*"
    r"(?P<power>[+-]?\d{1,2})|(?P<raised>[⁺⁻]?[⁰¹²³⁴⁵⁶⁷⁸⁹]{1,2}))?"
)
_RAISED = str.maketrans("⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "+-0123456789")
_MOST_DIGITS = 60
_LARGEST_EXPONENT = 400


class UnitError(ValueError):
    """A text that is no value of the wanted dimension.

    `found` says which part of it is wrong, if not the whole; `hint` suggests another unit.
    """

    def __init__(self, found: str = "", hint: str = "") -> None:
        super().__init__(found)
        self.found = found
        self.hint = hint


def exact(text: str, dimension: str) -> Fraction:
    """Return the exact SI value of a text with a unit.

    Parameters
    ----------
    text : str
        A decimal number and its unit, such as "60 deg", "7.8 g/cm^3", "9.81 m s^-2".
    dimension : str
        A key of `DIMENSIONS`.

    Returns
    -------
    Fraction
        The value in SI units, angles in radians; exact but for pi, which has 120 digits.

    Raises
    ------
    UnitError
        If the text is no number with a known unit, or its dimension is another one.
    """
    match = _QUANTITY.fullmatch(text) if len(text) <= 200 else None
    if match is None:
        raise UnitError
    number, unit_text = match.groups()
    if not unit_text:
        raise UnitError("no unit")
    unit = unit_of(unit_text)
    if unit.dimension != DIMENSIONS[dimension]:
        raise UnitError
    return _decimal(number) * unit.factor


def to_si(text: str, dimension: str) -> float:
    """Return the SI value of a text with a unit, rounded once to the nearest double.

    Parameters and errors are those of `exact`; a value too large for a double is a `UnitError`.
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
    """Return the unit a text names: factors with powers, joined by spaces, `*` or `/`.

    As in print, `/` divides by the next factor only: `kg/m/s` and `kg m^-1 s^-1` are the same.
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
        a, b, c, d = UNITS[name].dimension
        dimension = (
            dimension[0] + power * a,
            dimension[1] + power * b,
            dimension[2] + power * c,
            dimension[3] + power * d,
        )
        position = match.end()
    return Unit(factor, dimension)
