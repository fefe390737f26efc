"""Kernels of the library: numbers, arrays and tuples as arguments and results."""

from __future__ import annotations

import ctypes
import sys
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest

from vibro_cli.compile import native
from vibro_cli.compile.build import NATIVE, build, library_name
from vibro_cli.compile.kernel import (
    FloatMatrix,
    Overrides,
    Series,
    dtype,
    is_kernel,
    kernel,
    struct,
)
from vibro_cli.compile.native import compiled
from vibro_cli.compile.translate import Program
from vibro_cli.errors import NoLibrary


@struct
class Point:
    """A struct."""

    x: float
    count: int


class Plane(NamedTuple):
    """Named tuple of arrays."""

    points: Sequence[Point]
    far: Sequence[int]


@kernel
def half(number: float) -> float:
    return 0.5 * number


@kernel
def twice(number: float) -> float:
    return 2.0 * number


@kernel
def mixed(flag: bool, number: int, real: float, plane: Plane) -> tuple[int, float, bool]:
    plane.points[1].x += half(real)
    return number + plane.far[0], plane.points[1].x, not flag


@kernel
def total(points: Sequence[Point], table: FloatMatrix) -> float:
    found = 0.0
    for point in range(len(points)):
        found += points[point].x + float(points[point].count) * table[point, 1]
    return found


@kernel
def nothing(points: Sequence[Point]) -> None:
    points[0].count = 7


@kernel
def unnamed() -> int:
    return 1


DOUBLED = Overrides("doubled", {half: twice})


@pytest.fixture(scope="module", autouse=True)
def library(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Build a library of the kernels above, in place of the package's."""
    folder: Path = tmp_path_factory.mktemp("library")
    build([Program("test", (mixed, total, nothing)), Program("more", (mixed,), DOUBLED)], folder)
    made = ctypes.CDLL(str(folder / library_name(NATIVE)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(native, "library", lambda: made)
        yield


class Lazy(ModuleType):
    """A module that imports another when an attribute is requested, as some libraries do."""

    def __getattr__(self, name: str) -> object:
        sys.modules[f"{self.__name__}.{name}"] = ModuleType(name)
        return sys.modules[f"{self.__name__}.{name}"]


def test_a_library_is_built_beside_modules_that_import_lazily(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "lazy", Lazy("lazy"))
    before = set(sys.modules)
    build([Program("test", (nothing,))], tmp_path)
    assert (tmp_path / library_name(NATIVE)).exists()
    assert not any(name.startswith("lazy.") for name in set(sys.modules) - before)


def points_with(*values: float) -> Any:
    rows: Any = np.zeros(len(values), dtype=dtype(Point))
    rows["x"] = values
    return rows


def plane_with(*values: float) -> Plane:
    far: Any = np.array([40])
    return Plane(points_with(*values), far)


def test_numbers_and_tuples_go_in_and_out() -> None:
    plane = plane_with(1.0, 2.0)
    found = compiled(mixed)(True, 2, 3.0, plane)
    assert found == (42, 3.5, False)
    assert [type(value) for value in found] == [int, float, bool]
    assert plane.points["x"].tolist() == [1.0, 3.5]  # type: ignore[call-overload]


def test_arrays_go_in_and_nothing_comes_out() -> None:
    rows = points_with(1.0, 2.0)
    assert compiled(nothing)(rows) is None
    assert rows["count"].tolist() == [7, 0]
    assert compiled(total)(rows, np.array([[0.0, 0.5], [0.0, 9.0]])) == 1.0 + 3.5 + 2.0


def test_overrides_hold_in_both_engines() -> None:
    one, other = plane_with(1.0, 2.0), plane_with(1.0, 2.0)
    assert compiled(mixed, DOUBLED)(True, 2, 3.0, one) == (42, 8.0, False)
    points = [Point(), Point()]
    points[1].x = 2.0
    found = DOUBLED.interpreted(mixed)(True, 2, 3.0, Plane(points, [40]))
    assert found == (42, 8.0, False)
    assert compiled(mixed)(True, 2, 3.0, other) == (42, 3.5, False)


def test_overrides_hold_in_a_thread_that_begins_while_another_prepares_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fresh, found = Overrides("fresh", DOUBLED.replaced), []

    def call() -> None:
        points = [Point(), Point()]
        points[1].x = 2.0
        found.append(fresh.interpreted(mixed)(True, 2, 3.0, Plane(points, [40])))

    other = threading.Thread(target=call)

    def is_kernel_in_the_end(value: object) -> bool:
        if other.ident is None:
            other.start()
            other.join(0.1)
        return is_kernel(value)

    monkeypatch.setattr("vibro_cli.compile.kernel.is_kernel", is_kernel_in_the_end)
    call()
    other.join()
    assert found == [(42, 8.0, False)] * 2


@pytest.mark.parametrize(
    "table", [np.zeros((2, 2), dtype=np.int64), np.zeros(4), np.zeros((2, 3)).T]
)
def test_arrays_of_another_form_are_refused(table: Any) -> None:
    """C++ would misinterpret their memory."""
    with pytest.raises(TypeError, match="table: found an array of"):
        compiled(total)(points_with(1.0, 2.0), table)


def test_a_kernel_that_no_program_names_is_told() -> None:
    with pytest.raises(NoLibrary, match="it is named in no program"):
        compiled(unnamed)


def test_annotations_may_be_types_instead_of_texts() -> None:
    """As in a module that does not postpone their evaluation."""

    class Written:
        t: float
        piece: int
        terms: Series

    class Evaluated:
        __annotations__ = {"t": float, "piece": int, "terms": Series}

    assert dtype(struct(Evaluated)) == dtype(struct(Written))
    assert dtype(struct(Evaluated))["piece"] == np.int64
