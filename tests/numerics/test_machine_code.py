"""Kernels as machine code: numbers, arrays and tuples of them, in and out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest

from vibro_cli.numerics.engine import dtype, kernel, record
from vibro_cli.numerics.machine_code import compiled


@record
class Point:
    """A record."""

    x: float
    count: int


class Plane(NamedTuple):
    """Named tuple of arrays."""

    points: Sequence[Point]
    far: Sequence[int]


@kernel
def _half(number: float) -> float:
    return 0.5 * number


@kernel
def mixed(flag: bool, number: int, real: float, plane: Plane) -> tuple[int, float, bool]:
    plane.points[1].x += _half(real)
    return number + plane.far[0], plane.points[1].x, not flag


@kernel
def total(points: Sequence[Point], table: Any) -> float:
    found = 0.0
    for point in range(len(points)):
        found += points[point].x + float(points[point].count) * table[point, 1]
    return found


@kernel
def nothing(points: Sequence[Point]) -> None:
    points[0].count = 7


def points_with(*values: float) -> Any:
    rows: Any = np.zeros(len(values), dtype=dtype(Point))
    rows["x"] = values
    return rows


def test_numbers_and_tuples_go_in_and_out() -> None:
    far: Any = np.array([40])
    plane = Plane(points_with(1.0, 2.0), far)
    found = compiled(mixed)(True, 2, 3.0, plane)
    assert found == (42, 3.5, False)
    assert [type(value) for value in found] == [int, float, bool]
    assert plane.points["x"].tolist() == [1.0, 3.5]  # type: ignore[call-overload]


def test_arrays_go_in_and_nothing_comes_out() -> None:
    rows = points_with(1.0, 2.0)
    compiled(nothing)(rows)
    assert rows["count"].tolist() == [7, 0]
    assert compiled(total)(rows, np.array([[0.0, 0.5], [0.0, 9.0]])) == 1.0 + 3.5 + 2.0


@pytest.mark.parametrize("table", [np.zeros((2, 2), dtype=np.int64), np.zeros(4)])
def test_arrays_of_another_form_are_refused(table: Any) -> None:
    """The machine code would take their memory for something else."""
    rows = points_with(1.0, 2.0)
    compiled(total)(rows, np.zeros((2, 2)))
    with pytest.raises(TypeError, match="another form"):
        compiled(total)(rows, table)


def test_arrays_that_are_not_in_order_are_refused() -> None:
    with pytest.raises(TypeError, match="in C order"):
        compiled(total)(points_with(1.0, 2.0), np.zeros((2, 4))[:, ::2])


def test_too_few_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="zip"):
        compiled(total)(points_with(1.0))
