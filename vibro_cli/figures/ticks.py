"""Labels and ticks of axes: symbols of columns, ticks at parts of π and at round numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from matplotlib.axis import Axis, YAxis
from matplotlib.ticker import MaxNLocator

_SIDES = {"pre": " before", "post": " after"}
_SYMBOLS = {
    "t": "t",
    "dt": r"\Delta t",
    "s": "s",
    "x": "x",
    "y": "y",
    "speed": "v",
    "velocity_x": "v_x",
    "velocity_y": "v_y",
    "normal_speed": r"v_\mathrm{n}",
    "tangential_speed": r"v_\mathrm{t}",
    "omega": r"\omega",
    "energy": "E",
    "kinetic_energy": r"E_\mathrm{k}",
    "lyapunov": r"\lambda",
}
_NAME = re.compile(r"(?P<stem>.+?)(?:_(?P<body>[ab]|[0-9]+))?(?:_(?P<side>pre|post))?")


def symbol_of(column: str) -> str:
    """Return the label of a column as mathtext: `speed_a_pre` becomes v_a before.

    Columns without a symbol are named in words: `angle_a` becomes "angle of a".
    """
    found = _NAME.fullmatch(column)
    assert found is not None, column
    stem, body = found["stem"], found["body"] or ""
    side = _SIDES.get(found["side"] or "", "")
    symbol = _SYMBOLS.get(stem)
    if symbol is None:
        of = f" of {body}" if body.isalpha() else f" {body}".rstrip()
        return f"{stem.replace('_', ' ')}{of}{side}"
    letter, _, index = symbol.partition("_")
    below = ",".join(part for part in (index, body) if part)
    return f"${letter}_{{{below}}}${side}" if below else f"${letter}${side}"


CHARACTER = 1.15
"""Mean width of a character of a tick label (mm)."""
_BETWEEN = 1.6
"""Least room between two tick labels (mm)."""
_APART = 1.2
"""The same between labels of neighbouring panels (mm)."""
_INTERVAL = 17.0
"""Usual distance between the ticks of a long horizontal axis (mm)."""
_LINE = 7.0
"""Least distance between two tick labels one above the other (mm)."""
_OF_POWERS = (8.0, 5.5)
"""Least distance between two powers of ten side by side, and one above the other (mm)."""

_EDGE = 1.2
"""Room without numbers at the lower end of a vertical axis (mm), kept for those of another axis."""
_LONGEST = 5
"""Characters of the longest label of a vertical axis; longer numbers get a power of ten."""
_PLAIN = (0.01, 1e5)
"""Range of the greatest number of a horizontal axis without a power of ten."""

_PARTS_OF_PI = tuple(Fraction(1, divisor) for divisor in (1, 2, 4, 8))
_ENOUGH = 4
_MOST = 1000
"""Number of steps within an axis above which no figure has room for the labels."""
_NEAREST = 1e-9
"""Least range of an axis, as a share of its greatest number."""
_FROM_WITHIN = 2e-4
"""Range of an axis, as a share of its greatest number, below which labels have an offset."""
LEAST = 3
"""Least number of labels for a readable scale, where there is room for them."""


@dataclass(frozen=True)
class Ticks:
    """Places of ticks and their labels."""

    places: tuple[float, ...]
    labels: tuple[str, ...]
    power: int = 0
    """The labels are in units of ten to this power."""
    offset: float = 0.0
    """The labels are relative to this number."""


def angle_ticks(low: float, high: float, length: float, vertical: bool = False) -> Ticks:
    """Return ticks (rad) at multiples of π/2ⁿ for an axis from `low` to `high`, `length` mm long.

    The step is the largest that gives enough ticks, as far as there is room for the labels. Angles
    too small for parts of π get decimal numbers.
    """
    first = low + _EDGE / length * (high - low) if vertical else low
    chosen = None
    for part in _PARTS_OF_PI:
        step = float(part) * math.pi
        if high - first > _MOST * step:
            break
        numbers = range(math.ceil(first / step - 1e-9), math.floor(high / step + 1e-9) + 1)
        labels = tuple(part_of_pi(part * number) for number in numbers)
        room = step * length / (high - low)
        if not (room >= _LINE if vertical else _fits(labels, room)):
            break
        places = tuple(number * step for number in numbers)
        chosen = Ticks(places, labels) if len(numbers) > 1 else None
        if len(numbers) >= _ENOUGH:
            break
    return chosen or (vertical_ticks if vertical else number_ticks)(low, high, length)


def number_ticks(low: float, high: float, width: float, whole: bool = False) -> Ticks:
    """Return ticks at round numbers for a horizontal axis from `low` to `high`, `width` mm wide.

    With `whole`, only whole numbers are used.
    """
    offset = _offset(low, high)
    if offset:
        return _counted_from(offset, number_ticks(low - offset, high - offset, width, whole))
    largest = max(abs(low), abs(high))
    power = 0 if _PLAIN[0] <= largest < _PLAIN[1] or not largest else _power(largest)
    chosen = Ticks((), ())
    usual = max(5, round(width / _INTERVAL))
    for bins in range(1, 2 * usual):
        if bins > usual and len(chosen.places) >= LEAST:
            break
        ticks = _round_numbers(low, high, bins, whole, power)
        step = ticks.places[1] - ticks.places[0] if len(ticks.places) > 1 else high - low
        if chosen.places and not _fits(ticks.labels, step * width / (high - low)):
            break
        chosen = ticks
    return chosen


def vertical_ticks(low: float, high: float, height: float, whole: bool = False) -> Ticks:
    """Return ticks at round numbers for a vertical axis from `low` to `high`, `height` mm high.

    With `whole`, only whole numbers are used.
    """
    offset = _offset(low, high)
    if offset:
        return _counted_from(offset, vertical_ticks(low - offset, high - offset, height, whole))
    low += _EDGE / height * (high - low)
    most = max(2, int(height / _LINE))
    dense = _round_numbers(low, high, most, whole)
    for bins in range(most, 0, -1):  # fewer and shorter labels rather than a power of ten
        ticks = _round_numbers(low, high, bins, whole)
        if len(ticks.places) < min(LEAST, len(dense.places)):
            break
        if max(map(len, ticks.labels), default=0) <= _LONGEST:
            return ticks
    return _in_powers(dense.places, _power(max(map(abs, dense.places))))


def in_one_unit(one: Ticks, other: Ticks) -> tuple[Ticks, Ticks]:
    """Return the ticks of two axes of the same quantity, both scaled by the larger power of ten."""
    powers = {one.power, other.power} - {0}
    if not powers or one.offset or other.offset:
        return one, other
    power = max(powers)
    return _in_powers(one.places, power), _in_powers(other.places, power)


def log_ticks(low: float, high: float, length: float, vertical: bool, edge: float = _EDGE) -> Ticks:
    """Return ticks of a logarithmic axis, `length` mm long, between limits of the same sign.

    Ticks are at powers of ten; if there are fewer than three, at 1, 2 and 5 or at 1 and 3 times
    powers of ten; and if these are too few as well, at round numbers. A vertical axis has none
    within `edge` mm of its lower end.
    """
    if vertical:
        low *= (high / low) ** (edge / length)
    small, large = sorted((abs(low), abs(high)))
    per_decade = length / math.log10(large / small)
    first, last = math.ceil(math.log10(small) - 1e-9), math.floor(math.log10(large) + 1e-9)
    sign = "−" if high < 0.0 else ""
    if last - first + 1 >= LEAST:
        step = math.ceil(_OF_POWERS[vertical] / per_decade)
        powers = range(first, last + 1, step)
        labels = tuple(rf"{sign}$10^{{{power}}}$" for power in powers)
        return Ticks(tuple(math.copysign(10.0**power, high) for power in powers), labels)
    for factors, ratio in (((1, 2, 5), 2.0), ((1, 3), 3.0)):
        ticks = _times_powers(factors, small, large, high)
        gap = per_decade * math.log10(ratio)
        if len(ticks.places) >= LEAST and (gap >= _LINE if vertical else _fits(ticks.labels, gap)):
            return ticks
    if vertical:
        # The numbers are closer by half at most; labels above one another still do not touch.
        return vertical_ticks(low, high, length)
    # Ratio of the least distance of the numbers to their distance on a linear axis.
    nearer = (large - small) / (large * math.log(large / small))
    return number_ticks(low, high, length * nearer)


def _times_powers(factors: Sequence[int], small: float, large: float, signed: float) -> Ticks:
    """Return ticks at `factors` times all powers of ten between two sizes, signed as `signed`.

    Each label has only the digits that it needs.
    """
    power = 0 if _PLAIN[0] <= small and large < _PLAIN[1] else _power(large)
    minus = "−" if signed < 0.0 else ""
    low, high = small * (1.0 - 1e-9), large * (1.0 + 1e-9)
    decades = range(math.floor(math.log10(small)), math.floor(math.log10(large)) + 1)
    near = [float(f"{factor}e{decade}") for decade in decades for factor in factors]
    sizes = [size for size in near if low <= size <= high]
    labels = tuple(f"{minus}{size / 10.0**power:g}" for size in sizes)
    return Ticks(tuple(math.copysign(size, signed) for size in sizes), labels, power)


def _offset(low: float, high: float) -> float:
    """Return a round number between limits that are close relative to their size, else 0."""
    if not 0.0 < high - low < _FROM_WITHIN * max(abs(low), abs(high)):
        return 0.0
    return round(0.5 * (low + high), -math.floor(math.log10(high - low)))


def _counted_from(offset: float, ticks: Ticks) -> Ticks:
    """Return ticks of differences from `offset`, moved to the numbers themselves."""
    return replace(ticks, places=tuple(offset + place for place in ticks.places), offset=offset)


def _power(largest: float) -> int:
    """Return the power of ten, a multiple of three, that scales numbers up to `largest`."""
    return 3 * math.floor(math.log10(largest) / 3.0)


def axis_words(name: str, unit: str, ticks: Ticks) -> str:
    """Return the label of an axis with offset, power of ten and unit: `s − 1.2 [10⁻⁶ m]`."""
    if ticks.offset:
        name += f" {'−' if ticks.offset > 0.0 else '+'} {abs(ticks.offset):.12g}"
    unit = re.sub(r"\^(\d)", r"$^\1$", unit)
    scaled = rf"$10^{{{ticks.power}}}$ {unit}".rstrip() if ticks.power else unit
    return f"{name} [{scaled}]" if scaled else name


def label_axis(
    axis: Axis, ticks: Ticks, name: str, unit: str, labelled: bool = True, after: str = ""
) -> None:
    """Set the ticks of an axis with their labels, and its name with the unit, if it has one.

    Without `labelled`, only ticks are drawn. `after` is appended to the unit.
    """
    axis.set_ticks(ticks.places, ticks.labels if labelled else [""] * len(ticks.labels))
    axis.minorticks_off()  # a logarithmic axis would add its own labels between these
    if isinstance(axis, YAxis):
        axis.labelpad = 1.0
    if labelled:
        axis.set_label_text(axis_words(name, unit, ticks) + after)


def _round_numbers(low: float, high: float, bins: int, whole: bool, power: int = 0) -> Ticks:
    locator = MaxNLocator(nbins=bins, steps=[1, 2, 2.5, 5, 10], integer=whole)
    values = locator.tick_values(low, high)
    places = tuple(float(value) for value in values if low <= value <= high)
    return _in_powers(places, power)


def _in_powers(places: tuple[float, ...], power: int) -> Ticks:
    return Ticks(places, decimals([place / 10.0**power for place in places]), power)


def limits_apart(low: float, high: float) -> tuple[float, float]:
    """Return the limits of an axis, moved apart if hardly any double lies between them."""
    room = 0.5 * (_NEAREST * max(abs(low), abs(high)) - (high - low))
    return (low - room, high + room) if room > 0.0 else (low, high)


def round_below(value: float) -> float:
    """Return the greatest number of the series …, 0.2, 0.5, 1, 2, 5, 10, … up to `value`."""
    power = 10.0 ** math.floor(math.log10(value))
    # The logarithm of a number just below a power of ten may be rounded up: then 0.5 is the factor.
    return next(factor * power for factor in (5.0, 2.0, 1.0, 0.5) if factor * power <= value)


def decimals(values: Sequence[float]) -> tuple[str, ...]:
    """Return numbers as text, all with as many decimals as any needs and with true minus signs."""
    for digits in range(9):
        if all(
            abs(round(value, digits) - value) <= 1e-9 * max(map(abs, values)) for value in values
        ):
            break
    return tuple(f"{value + 0.0:.{digits}f}".replace("-", "−") for value in values)


def part_of_pi(part: Fraction) -> str:
    """Return a multiple of π as text: −3π/4, −π, 0, π/2."""
    if part == 0:
        return "0"
    sign = "−" if part < 0 else ""
    factor = "" if abs(part.numerator) == 1 else str(abs(part.numerator))
    divisor = "" if part.denominator == 1 else f"/{part.denominator}"
    return f"{sign}{factor}π{divisor}"


def _fits(labels: Sequence[str], step: float) -> bool:
    """Return whether labels at intervals of `step` mm do not touch."""
    return max((len(label) for label in labels), default=0) * CHARACTER + _BETWEEN <= step


def without_overlaps(
    rows: Sequence[tuple[float, float, Ticks]], span: Sequence[tuple[float, float]]
) -> list[Ticks]:
    """Return the ticks of panels side by side, without labels that would overlap another.

    `rows` holds, for each panel, its left edge (mm), its width (mm) and its ticks, `span` the ends
    of its axis. Of two overlapping labels, the one nearer to the edge of its panel is dropped.
    """
    shown = [list(ticks.labels) for _, _, ticks in rows]
    # Each mark: place and distance from the edge of its panel (mm), half the width of its label
    # (mm), and where that is: the labels of the panel and a number.
    last: tuple[float, float, float, list[str], int] | None = None
    for labels, (left, width, ticks), (low, high) in zip(shown, rows, span, strict=True):
        for number, place in enumerate(ticks.places):
            share, half = (place - low) / (high - low), 0.5 * CHARACTER * len(labels[number])
            mark = left + width * share, min(share, 1.0 - share) * width, half, labels, number
            if last is None or mark[0] - last[0] >= half + last[2] + _APART:
                last = mark
            else:
                out, last = (mark, last) if mark[1] < last[1] else (last, mark)
                texts, dropped = out[3:]
                texts[dropped] = ""
    return [
        replace(ticks, labels=tuple(labels))
        for labels, (_, _, ticks) in zip(shown, rows, strict=True)
    ]
