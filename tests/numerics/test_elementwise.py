"""Functions of numbers and arrays alike: an array's elements have the bits of single numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from vibro_cli.mechanics.trace import ArcShape, Trace
from vibro_cli.numerics import elementwise

NUMBERS = np.concatenate(
    [
        np.random.default_rng(3).uniform(-8.0, 8.0, 4000),
        [0.0, -0.0, 1.0, -1.0, math.pi, 0.5 * math.pi, 1e-300, 5e-324, 1e22, math.tau],
    ]
)
ONE: list[Callable[[Any], Any]] = [
    elementwise.sine,
    elementwise.cosine,
    elementwise.arcsine,
    lambda x: elementwise.square_root(abs(x)),
    lambda x: elementwise.power(x, 3),
    elementwise.nearest,
    elementwise.ceiling,
    lambda x: elementwise.exact_sum([x, 0.1, -x, 1e-17]),
    elementwise.last_place,
    lambda x: elementwise.choose(x > 0.3, x, 2.0),
    lambda x: elementwise.outside(x, -0.5, math.pi),
    lambda x: elementwise.is_nan(elementwise.arcsine(x)),
    lambda x: elementwise.least(x, 0.5),
    lambda x: elementwise.greatest_of([x, 0.5, 0.7]),
    lambda x: elementwise.least_of([0.5, x]),
]


@pytest.mark.parametrize("number", range(len(ONE)))
def test_elements_are_as_numbers(number: int) -> None:
    function = ONE[number]
    single = np.array([function(value) for value in NUMBERS.tolist()], dtype=np.float64)
    many = np.asarray(function(NUMBERS), dtype=np.float64)
    assert many.tobytes() == single.tobytes()


def test_many_traces_are_as_single_ones() -> None:
    rng = np.random.default_rng(5)
    count = 200
    start, radius = rng.uniform(-2.0, -1.0, count), rng.uniform(0.5, 2.0, count)
    length = rng.uniform(0.1, 3.0, count)
    end = rng.uniform(-0.9, 1.5, count)

    def chain(a: Any, r: Any, e: Any, line: Any) -> Trace:
        valley, hump = ArcShape("valley", r, None, e), ArcShape("hump", 0.7, None, -2.0)
        return Trace.chain(a, [valley, ArcShape("line", None, line), hump])

    many = chain(start, radius, end, length)
    for n in range(count):
        one = chain(*(float(column[n]) for column in (start, radius, end, length)))
        for piece, other in zip(one.pieces, elementwise.taken(many, n).pieces, strict=True):
            assert re.sub(r"np\.float64\(([^)]*)\)", r"\1", repr(other)) == repr(piece)
