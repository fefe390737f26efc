"""Numbers with derivatives against derivatives by high-precision differences."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest

from vibro_cli.numerics import elementwise
from vibro_cli.numerics.elementwise import Dual

FUNCTIONS: tuple[tuple[Callable[[Any], Any], Callable[[Any], Any]], ...] = (
    (lambda x: 3.0 - x * x / (1.0 + x), lambda x: 3 - x * x / (1 + x)),
    (lambda x: (2.0 / x - 1.0) * abs(-x), lambda x: (2 / x - 1) * x),
    (
        lambda x: elementwise.sine(x) * elementwise.cosine(x),
        lambda x: mpmath.sin(x) * mpmath.cos(x),
    ),
    (lambda x: elementwise.arcsine(x) - x, lambda x: mpmath.asin(x) - x),
    (lambda x: elementwise.square_root(2.0 * x), lambda x: mpmath.sqrt(2 * x)),
    (lambda x: elementwise.power(x, 3), lambda x: x**3),
    (lambda x: elementwise.exact_sum((x, 1.0, x)), lambda x: 2 * x + 1),
    (lambda x: elementwise.greatest(x, 0.1) + np.float64(2.0) * x, lambda x: 3 * x),
)


@pytest.mark.parametrize(("function", "exact"), FUNCTIONS)
def test_derivatives_are_those_of_the_function(
    function: Callable[[Any], Any], exact: Callable[[Any], Any]
) -> None:
    found = function(Dual(0.3, np.array([1.0, 0.0, -2.0])))
    with mpmath.workdps(40):
        slope = float(mpmath.diff(exact, mpmath.mpf(0.3)))
        assert found.value == pytest.approx(float(exact(mpmath.mpf(0.3))), rel=1e-15)
    np.testing.assert_allclose(found.change, [slope, 0.0, -2.0 * slope], rtol=1e-14)


def test_no_derivative_is_lost() -> None:
    x = Dual(0.0, np.array([1.0]))
    with pytest.raises(TypeError):
        math.tan(x)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="derivative"):
        elementwise.each(math.tan, x)
    assert x != 0.0
    assert Dual(0.0, np.zeros(1)) == 0.0
