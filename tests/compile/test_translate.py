"""Every rule of the kernels' subset: what C++ is made of it, and what is refused, and where."""

from __future__ import annotations

import ctypes
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from vibro_cli.compile import native
from vibro_cli.compile.build import BuildError, build, library_name
from vibro_cli.compile.kernel import (
    LANES,
    Lanes,
    Series,
    TranslationError,
    any_lane,
    dtype,
    extract,
    has_bit,
    insert,
    kernel,
    pack,
    struct,
)
from vibro_cli.compile.native import compiled
from vibro_cli.compile.translate import Program, literal
from vibro_cli.systems.driver import zeros

WHOLE = -7
FACTORS = (0.5, -0.25, 1e-300)
COUNTS = (3, 5)
TABLE = ((1.0, 2.0), (3.0, 4.0))


@struct
class Cell:
    """A struct with a row of numbers."""

    x: float
    n: int
    row: Series


@struct
class Wide:
    """A struct in lanes."""

    x: Lanes
    y: Lanes


@kernel
def arithmetic(a: float, b: float, i: int, j: int) -> tuple[float, float, float, int, int]:
    c = a * b - a / b + math.pow(a, 2.0)
    k = i // j
    k += WHOLE
    return c, a % b, i / j, i % j, k


@kernel
def functions(a: float, b: float) -> tuple[float, float, float, float, int, int]:
    x = math.sqrt(a) + math.sin(b) * math.atan2(a, b) - math.copysign(a, b)
    y = math.cosh(b) + math.exp(-a) + math.log(a)
    return x, y, min(a, b, 0.5), max(a, b) + abs(b), math.floor(b), math.ceil(a)


@kernel
def control(limit: int) -> int:
    found = 0
    for i in range(limit):
        if i % 3 == 0:
            continue
        found += i
        if found > 40 or i == 30:
            break
    for i in range(10, 0, -4):
        found += 100 * i
    for i in range(2, 4):
        found += 10000 * i
    n: int = 0
    while not n >= 3:
        n += 1
    return found + n + i


@kernel
def strides(step: int) -> int:
    found = 0
    for i in range(5, 0, step):
        found = 10 * found + i
    for i in range(0, 5, step):
        found = 10 * found + i
    for i in range(0, 20, step):
        found += i
        step = 3  # a stride is evaluated once
    return found


@kernel
def constants(i: int, j: int) -> float:
    pair = (FACTORS[i], TABLE[i][j])
    three = (0.0625 * pair[0], 16.0, 256.0 * pair[1])
    return pair[0] + pair[1] + math.pi + float(COUNTS[i]) + three[0] * three[2]


@kernel
def swapped(a: float, b: float, flag: bool) -> tuple[float, float, bool]:
    a, b = b, a
    low, high = _ordered(a, b)
    return low, high if flag else 0.0, 0.0 < a <= b < 2.0


@kernel
def _ordered(a: float, b: float) -> tuple[float, float]:
    return (a, b) if a < b else (b, a)


@kernel
def cells(rows: Sequence[Cell], at: int) -> float:
    cell = rows[at]
    cell.row[2] += 1.5
    cell.n = at
    rows[at + 1] = cell  # type: ignore[index]
    total = 0.0
    for n in range(8):
        total += cell.row[n]
    return total + _reach(cell)


@kernel
def _reach(cell: Cell) -> float:
    return cell.x


@kernel
def in_lanes(rows: Sequence[Wide]) -> float:
    a = rows[0]
    larger = a.x > a.y
    mixed = math.sqrt(a.x) if larger else -a.y
    mixed = mixed if larger or (a.x > 0.0 and not larger) else 0.0
    mixed = mixed + 1.0 if has_bit(a.y, 1) else abs(mixed)
    a.x = max(min(mixed, 1e3), 2.0 * a.y)
    pair = insert(pack(extract(a.x, 3), 2.0), 1, 5.0)
    return extract(pair * pair, 1) + _half(extract(a.x, 0)) if any_lane(larger) else -1.0


@kernel
def _half(x: Lanes) -> Lanes:
    return 0.5 * x


ENTRIES = (arithmetic, functions, control, strides, constants, swapped, cells, in_lanes)


@pytest.fixture(scope="module", autouse=True)
def library(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Build a library of the kernels above, in place of the package's."""
    folder: Path = tmp_path_factory.mktemp("library")
    build([Program("rules", ENTRIES)], folder)
    made = ctypes.CDLL(str(folder / library_name("native")))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(native, "library", lambda: made)
        yield


@pytest.mark.parametrize(
    "arguments", [(3.7, -1.3, 17, 5), (-3.7, 1.3, -17, 5), (1e-9, 2e8, 17, -5), (0.1, 0.3, -1, -3)]
)
def test_arithmetic_is_that_of_the_interpreter(arguments: Any) -> None:
    assert compiled(arithmetic)(*arguments) == arithmetic(*arguments)


@pytest.mark.parametrize("a", [0.3, 1.0, 7.9])
@pytest.mark.parametrize("b", [-2.5, -0.0, 0.7, 3.0])
def test_functions_are_those_of_the_interpreter(a: float, b: float) -> None:
    assert compiled(functions)(a, b) == functions(a, b)


@pytest.mark.parametrize("limit", [0, 1, 7, 12, 50])
def test_loops_go_where_the_interpreter_goes(limit: int) -> None:
    assert compiled(control)(limit) == control(limit)


@pytest.mark.parametrize(("a", "b"), [(-4.0, 2.0), (-0.0, 2.0), (4.0, -2.0), (0.0, -2.0)])
def test_what_is_left_of_whole_multiples_has_the_sign_of_the_divisor(a: float, b: float) -> None:
    assert compiled(arithmetic)(a, b, 1, 1)[1] == a % b == 0.0
    assert math.copysign(1.0, compiled(arithmetic)(a, b, 1, 1)[1]) == math.copysign(1.0, a % b)


@pytest.mark.parametrize("step", [-7, -2, -1, 1, 2, 7])
def test_strides_go_up_and_down(step: int) -> None:
    assert compiled(strides)(step) == strides(step)


def test_constants_and_tuples() -> None:
    for i in range(2):
        for j in range(2):
            assert compiled(constants)(i, j) == constants(i, j)
    for given in ((1.0, 2.0, True), (2.0, 1.0, False), (0.5, 1.5, True)):
        assert compiled(swapped)(*given) == swapped(*given)


def test_elements_are_structs_by_reference_and_assigned_by_value() -> None:
    rows: Any = np.zeros(3, dtype=dtype(Cell))
    rows["row"] = np.arange(24.0).reshape(3, 8)
    rows["x"] = 0.25
    assert compiled(cells)(rows, 1) == 8 * 11.5 + 1.5 + 0.25
    assert rows["n"].tolist() == [0, 1, 1]
    assert rows["row"][2].tolist() == rows["row"][1].tolist()


def test_lanes_across_lines_of_the_cache_are_refused() -> None:
    """C++ would read them with instructions that end the process."""
    room = zeros(2, Wide).view(np.uint8)
    with pytest.raises(TypeError, match=r"rows: found address .*, expected a multiple of 64"):
        compiled(in_lanes)(room[8 : 8 + dtype(Wide).itemsize].view(dtype(Wide)))


def test_every_lane_has_the_bits_of_a_number() -> None:
    rows = zeros(1, Wide)
    x, y = np.linspace(-1.0, 6.0, LANES), np.arange(LANES, dtype=float)
    rows["x"][0, 0], rows["y"][0, 0] = x, y
    compiled(in_lanes)(rows)
    for lane in range(LANES):
        one = Wide()
        one.x, one.y = float(x[lane]), float(y[lane])
        larger = one.x > one.y
        mixed = math.sqrt(one.x) if larger else -one.y
        mixed = mixed if larger or one.x > 0.0 else 0.0
        mixed = mixed + 1.0 if int(one.y) & 1 else abs(mixed)
        assert rows["x"][0, 0, lane] == max(min(mixed, 1e3), 2.0 * one.y)


@pytest.mark.parametrize("value", [0.1, -1e-300, 5e-324, math.inf, 3, -(2**62), True])
def test_numbers_are_written_exactly(value: Any) -> None:
    text = literal(value).replace("INFINITY", "inf").replace("INT64_C", "")
    text = text.replace("true", "True")
    assert eval(text, {"inf": math.inf}) == value  # the text of a number


# Constructs that the subset does not have.


@kernel
def of_no_type_in_a_tuple(a: float) -> tuple[float, str]:
    return a, ""


@kernel
def of_no_type(a) -> float:  # type: ignore[no-untyped-def]
    return float(a)


@kernel
def of_text(a: float) -> float:
    return a if str(a) else 0.0


@kernel
def of_list(a: float) -> float:
    values = [a, a]
    return values[0]


@kernel
def of_two_types(rows: Sequence[Cell], a: float) -> float:
    x = rows[0]
    x = a  # type: ignore[assignment]
    return x  # type: ignore[return-value]


@kernel
def of_itself(a: float) -> float:
    return of_itself(a - 1.0) if a > 0.0 else a


@kernel
def of_itself_after_a_return(a: float) -> float:
    if a < 0.0:
        return a
    return of_itself_after_a_return(a - 1.0)


@kernel
def of_itself_for_nothing(a: float) -> None:
    if a > 0.0:
        of_itself_for_nothing(a - 1.0)


@kernel
def of_the_first_that_is_not_zero(i: int, j: int) -> int:
    return i or j


@kernel
def of_other_loops(rows: Sequence[Cell]) -> float:
    total = 0.0
    for row in rows:
        total += row.x
    return total


@kernel
def of_no_field(rows: Sequence[Cell]) -> float:
    return rows[0].y  # type: ignore[attr-defined,no-any-return]


@kernel
def of_keywords(a: float) -> float:
    return _reach(cell=a)  # type: ignore[arg-type]


@kernel
def of_lanes_as_truth(rows: Sequence[Wide]) -> float:
    if rows[0].x > 0.0:
        return 1.0
    return 0.0


@kernel
def of_remainders_of_lanes(rows: Sequence[Wide]) -> float:
    rest = rows[0].x % 0.5
    return extract(rest, 0)


@kernel
def of_wrong_number(a: float) -> float:
    return _reach(a, a)  # type: ignore[call-arg,arg-type]


@kernel
def of_try(a: float) -> float:
    try:
        return 1.0 / a
    except ZeroDivisionError:
        return 0.0


@kernel
def of_else(a: float) -> float:
    while a > 1.0:
        a *= 0.5
    else:
        a = 0.0
    return a


@kernel
def of_several_results(rows: Sequence[Cell], a: float) -> float:
    if a > 0.0:
        return a
    return rows[0]  # type: ignore[return-value]


@kernel
def of_fewer_names(a: float) -> float:
    low, high, _ = _ordered(a, a)  # type: ignore[misc]
    return low + high  # type: ignore[no-any-return]


@kernel
def of_no_elements(a: float) -> float:
    return a[0]  # type: ignore[index,no-any-return]


@kernel
def of_a_later_type() -> float:
    x = 0
    x = 0.5  # type: ignore[assignment]
    return x


@kernel
def of_shifts(i: int) -> int:
    return i << 2


@kernel
def of_several_targets(a: float) -> float:
    x = y = a
    return x + y


@kernel
def of_a_negative_truth(a: float) -> int:
    return -(a > 0.0)


@kernel
def of_a_sum_of_truths(a: float) -> int:
    return (a > 0.0) + (a > 1.0)


@kernel
def of_an_integer_as_truth(i: int) -> int:
    if i:
        return 1
    return 0


@kernel
def of_an_item_by_a_variable(i: int) -> float:
    pair = (0.5, 1.5)
    return pair[i]


@kernel
def of_powers(a: float) -> float:
    return a**2.0  # type: ignore[no-any-return]


@kernel
def of_whole_quotients_of_reals(a: float) -> float:
    return a // 0.3


@kernel
def of_membership(a: float) -> bool:
    return a in FACTORS


@kernel
def of_fewer_results(a: float) -> tuple[float, float, float]:
    return _ordered(a, a)  # type: ignore[return-value]


@kernel
def of_an_integer_for_a_float(i: int) -> float:
    return i


@kernel
def of_an_item_beyond_the_last(a: float) -> float:
    return _ordered(a, a)[2]  # type: ignore[misc,no-any-return]


@kernel
def of_no_bounds(i: int) -> int:
    found = 0
    for n in range():  # type: ignore[call-overload]
        found += n
    return found + i


@kernel
def of_two_forms(a: float | None) -> float:
    return a or 0.0


@kernel
def of_a_choice_of_two_types(rows: Sequence[Cell], a: float) -> float:
    return rows[0] if a > 0.0 else a  # type: ignore[return-value]


@kernel
def _nothing(a: float) -> None:
    pass


@kernel
def of_no_value(a: float) -> float:
    x = _nothing(a)
    return x  # type: ignore[return-value]


def a_struct_of_truths() -> None:
    @struct
    class Switch:
        on: bool


def a_struct_of_arrays() -> None:
    @struct
    class Rows:
        row: list[float]


def a_struct_of_texts() -> None:
    @struct
    class Named:
        name: str


@pytest.mark.parametrize(
    ("declare", "text"),
    [
        (a_struct_of_truths, r"test_translate\.Switch: on: found 'bool', expected float, int, "),
        (a_struct_of_arrays, r"Rows: row: found 'list\[float\]', expected float, int, Series"),
        (a_struct_of_texts, "Named: name: found 'str', expected float"),
    ],
)
def test_a_field_that_numpy_and_cpp_would_place_differently_is_refused(
    declare: Callable[[], None], text: str
) -> None:
    """C++ aligns the field after a truth value, and an array takes more than one number."""
    with pytest.raises(TranslationError, match=text):
        declare()


@kernel
def of_no_variable(a: float) -> float:
    return a + ENTRIES  # type: ignore[operator]


@pytest.mark.parametrize(
    ("function", "text"),
    [
        (of_else, "no else of a loop"),
        (of_several_results, r"found a value of type Cell\*, expected double"),
        (of_fewer_names, "expected a tuple of 3 values"),
        (of_no_elements, "a has no elements"),
        (of_shifts, "a kernel has no such operator of int64_t"),
        (of_several_targets, "expected one target, or a tuple of them"),
        (of_a_negative_truth, "a kernel has no such operator of bool"),
        (of_a_sum_of_truths, "a kernel has no such operator of bool"),
        (of_an_integer_as_truth, "found i, expected a truth value"),
        (of_an_item_by_a_variable, "pair has no items by variable indices"),
        (of_powers, "a kernel has no such operator of double"),
        (of_whole_quotients_of_reals, "a kernel has no such operator of double"),
        (of_a_later_type, "x is given values of two types, int64_t and double"),
        (of_membership, "a in FACTORS"),
        (of_no_variable, "ENTRIES is no variable"),
        (of_no_type, "expected a type of numbers"),
        (of_no_type_in_a_tuple, "expected a type of numbers"),
        (of_text, "str is no kernel"),
        (of_list, "a kernel has no list"),
        (of_two_types, "x is given values of two types"),
        (of_itself, "of_itself calls itself"),
        (of_itself_after_a_return, "calls itself"),
        (of_itself_for_nothing, "calls itself"),
        (of_the_first_that_is_not_zero, "found i, expected a truth value"),
        (of_other_loops, "expected `for name in range"),
        (of_no_field, "has no field y"),
        (of_keywords, "by position only"),
        (of_lanes_as_truth, "expected one truth value"),
        (of_remainders_of_lanes, "a kernel has no such operator of Lanes<8>"),
        (of_wrong_number, "is given 2 of 1 arguments"),
        (of_try, "a kernel has no try"),
        (of_fewer_results, "found a value of type Tuple<double, double>, expected Tuple<double, d"),
        (of_an_integer_for_a_float, "found a value of type int64_t, expected double"),
        (of_an_item_beyond_the_last, "has no item 2"),
        (of_no_bounds, "expected `for name in range"),
        (of_two_forms, "expected a type of numbers"),
        (of_a_choice_of_two_types, r"found Cell\* and double, expected numbers, or values of one"),
        (of_no_value, "x is given no value, expected a number or a struct"),
    ],
)
def test_what_the_subset_does_not_have_is_told_with_its_place(
    function: Callable[..., Any], text: str
) -> None:
    with pytest.raises(TranslationError, match=text) as caught:
        Program("wrong", (function,)).source()
    path, line = str(caught.value).split(":")[:2]
    code = function.__code__
    assert path.endswith("test_translate.py")
    assert 0 <= int(line) - code.co_firstlineno <= 5


TWIN = """
from vibro_cli.compile.kernel import kernel


@kernel
def twin(a: float) -> float:
    return a
"""


def test_no_two_kernels_have_one_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last word of their modules tells kernels apart; of two alike the compiler tells."""
    modules: list[Any] = [ModuleType(name) for name in ("one.place", "other", "another.place")]
    for module in modules:
        monkeypatch.setitem(sys.modules, module.__name__, module)
        path = tmp_path / f"{module.__name__}.py"
        path.write_text(TWIN)
        exec(compile(TWIN, path, "exec"), vars(module))  # the text above
    one, other, another = (module.twin for module in modules)
    text = Program("twins", (one, other)).source()
    assert "return place::twin(a);" in text
    assert "return other::twin(a);" in text
    with pytest.raises(BuildError, match=r"place\.py:6:.*redefinition of .*place::twin"):
        build([Program("twins", (one, another))], tmp_path)


def test_the_source_points_to_the_kernels() -> None:
    text = Program("rules", (control,)).source()
    assert "static int64_t control(int64_t limit) {" in text
    assert f'#line {control.__code__.co_firstlineno + 1} "' in text


def test_pointers_are_eight_bytes() -> None:
    """The words that pass arrays have this size."""
    assert ctypes.sizeof(ctypes.c_void_p) == 8
