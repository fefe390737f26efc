from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vibro_cli.scenario.quantities import (
    DIMENSIONS,
    PI,
    UNITS,
    Quantity,
    UnitError,
    exact,
    to_si,
    unit_of,
)


def test_pi_has_120_digits() -> None:
    with mpmath.workdps(140):
        difference = abs(mpmath.mpf(PI.numerator) / PI.denominator - mpmath.pi)
        assert difference < mpmath.mpf(10) ** -118


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("12 cm", "length", Fraction(12, 100)),
        ("32.8 grams", "mass", Fraction(328, 10_000)),
        ("2 kilograms", "mass", Fraction(2)),
        ("0.1 in", "length", Fraction(254, 100000)),
        ("1e-3 km", "length", Fraction(1)),
        ("-.5 mm", "length", Fraction(-5, 10000)),
        ("7.8 g/cm^3", "density", Fraction(7800)),
        ("7.8 g cm^-3", "density", Fraction(7800)),
        ("7.8 g/cm³", "density", Fraction(7800)),
        ("7.8g/cm**3", "density", Fraction(7800)),
        ("7.8 kg/l", "density", Fraction(7800)),
        ("2 min", "time", Fraction(120)),
        ("250 ms", "time", Fraction(1, 4)),
        ("9.81 m/s^2", "acceleration", Fraction(981, 100)),
        ("9.81 m/s/s", "acceleration", Fraction(981, 100)),
        ("1 g0", "acceleration", Fraction(980665, 100000)),
        ("36 km/h", "speed", Fraction(10)),
        ("3 t", "mass", Fraction(3000)),
        ("2 rad/s", "angular rate", Fraction(2)),
        ("3 N/m", "stiffness", Fraction(3)),
        ("2.5 kN/m", "stiffness", Fraction(2500)),
        ("3 kg/s^2", "stiffness", Fraction(3)),
    ],
)
def test_units_without_pi_are_exact(text: str, dimension: str, value: Fraction) -> None:
    assert exact(text, dimension) == value
    assert to_si(text, dimension) == float(value)


@pytest.mark.parametrize(
    ("text", "dimension", "times_pi"),
    [
        ("60 deg", "angle", Fraction(1, 3)),
        ("-120°", "angle", Fraction(-2, 3)),
        ("0.25 turn", "angle", Fraction(1, 2)),
        ("100 gon", "angle", Fraction(1, 2)),
        ("30 arcmin", "angle", Fraction(1, 360)),
        ("30 rpm", "angular rate", Fraction(1)),
        ("5 deg/s", "angular rate", Fraction(1, 36)),
        ("2 rev/min", "angular rate", Fraction(1, 15)),
    ],
)
def test_angles_are_the_nearest_doubles(text: str, dimension: str, times_pi: Fraction) -> None:
    assert to_si(text, dimension) == _nearest_double(times_pi)


@given(st.fractions(min_value=-1000, max_value=1000, max_denominator=1).map(int), st.integers(0, 6))
def test_degrees_are_rounded_once(whole: int, decimals: int) -> None:
    value = Fraction(whole, 10**decimals)
    text = f"{float(value):.{decimals}f} deg"
    assert to_si(text, "angle") == _nearest_double(value / 180)


def _nearest_double(times_pi: Fraction) -> float:
    """Return the double nearest to a multiple of pi, by 60 digits of mpmath."""
    with mpmath.workdps(60):
        value = mpmath.pi * times_pi.numerator / times_pi.denominator
        return float(Fraction(int(mpmath.nint(value * mpmath.mpf(2) ** 180)), 2**180))


@pytest.mark.parametrize("name", sorted(UNITS))
def test_every_unit_is_understood_by_its_name(name: str) -> None:
    assert unit_of(name) == UNITS[name]


@pytest.mark.parametrize("dimension", sorted(DIMENSIONS))
def test_a_value_of_one_dimension_is_of_no_other(dimension: str) -> None:
    units = {
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
    for other, unit in units.items():
        if other == dimension:
            assert to_si(f"2 {unit}", dimension) == 2.0
        else:
            with pytest.raises(UnitError):
                to_si(f"2 {unit}", dimension)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "m",
        "12",
        "1.2.3 m",
        "one m",
        "1 m m",
        "1 /m",
        "1 m/",
        "1 m^",
        "1 m^99",
        "1 metre per",
        "0x10 m",
        "1_000 m",
        "1e999999999 m",
        "1e400 m",
        "9" * 61 + " m",
        "inf m",
        "nan m",
        "1 m" + " " * 300,
    ],
)
def test_what_is_no_length(text: str) -> None:
    with pytest.raises(UnitError):
        to_si(text, "length")


def test_no_number_is_allowed_that_is_not_finite() -> None:
    for kind in (
        Quantity("length"),
        Quantity("length", at_least=0.0),
        Quantity("length", above=0.0),
    ):
        allowed = kind.allows(np.array([1.0, np.inf, -np.inf, np.nan]))
        assert allowed.tolist() == [True, False, False, False]
