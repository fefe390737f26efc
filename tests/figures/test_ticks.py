"""Ticks of angles in parts of π, and of other quantities in round numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.figure import Figure

from vibro_cli.figures.chart import Sheet, count_axis, plane_axes, positive_axis
from vibro_cli.figures.labels import text_width
from vibro_cli.figures.maps import Coordinate
from vibro_cli.figures.ticks import (
    Ticks,
    angle_ticks,
    axis_words,
    decimals,
    in_one_unit,
    label_axis,
    limits_apart,
    log_ticks,
    number_ticks,
    round_below,
    vertical_ticks,
    without_overlaps,
)


@pytest.mark.parametrize(
    ("low", "high", "width", "labels"),
    [
        (-math.pi, math.pi, 70.0, ("−π", "−π/2", "0", "π/2", "π")),
        (-math.radians(120), math.radians(50), 27.0, ("−π/2", "−π/4", "0", "π/4")),
        (-math.radians(50), math.radians(50), 16.0, ("−π/4", "0", "π/4")),
        (0.0, 2 * math.pi, 12.0, ("0", "π", "2π")),
        (math.pi / 2, 2 * math.pi, 70.0, ("π/2", "π", "3π/2", "2π")),
    ],
)
def test_angles_are_parts_of_pi(
    low: float, high: float, width: float, labels: tuple[str, ...]
) -> None:
    ticks = angle_ticks(low, high, width)
    assert ticks.labels == labels
    assert all(low - 1e-9 <= place <= high + 1e-9 for place in ticks.places)


@pytest.mark.parametrize("vertical", [False, True])
@pytest.mark.parametrize("unit", ["rad", "m"])
@pytest.mark.parametrize("length", [52.0, 72.0, pytest.param(140.0, marks=pytest.mark.long)])
def test_an_axis_of_a_grid_has_three_labels(length: float, unit: str, vertical: bool) -> None:
    """Angles as they are given in degrees, everywhere on the circle."""
    for start in range(-180, 180, 5):
        for wide in (2, 5, 10, 20, 30, 45, 60, 90, 120, 180, 360):
            low, high = math.radians(start), math.radians(start + wide)
            axis = Coordinate("angle", unit, np.array([low, high]), ())
            assert len(axis.ticks(low, high, length, vertical).labels) >= 3


@pytest.mark.parametrize("high", [1e6, 1e12, 1e300])
@pytest.mark.parametrize("vertical", [False, True])
def test_an_axis_of_many_turns_has_few_labels(high: float, vertical: bool) -> None:
    """An angle of an invalid point of a grid may be huge; its axis takes no longer to draw."""
    axis = Coordinate("angle", "rad", np.array([0.0, high]), ())
    ticks = axis.ticks(0.0, high, 72.0, vertical)
    assert 3 <= len(ticks.labels) <= 12
    assert all(0.0 <= place <= high for place in ticks.places)


def test_small_angles_are_decimal() -> None:
    ticks = angle_ticks(0.1, 0.11, 60.0)
    assert ticks.labels == ("0.100", "0.102", "0.104", "0.106", "0.108", "0.110")


@pytest.mark.parametrize(
    ("low", "high", "labels", "power"),
    [
        (1e-3, 1.0, ("$10^{-3}$", "$10^{-2}$", "$10^{-1}$", "$10^{0}$"), 0),
        (-5.0, -0.05, ("−0.05", "−0.1", "−0.2", "−0.5", "−1", "−2", "−5"), 0),
        (2e-7, 5e-6, ("0.2", "0.5", "1", "2", "5"), -6),
        (0.7, 1.0, ("0.7", "0.8", "0.9", "1.0"), 0),
        (1e-30, 1e30, tuple(f"$10^{{{power}}}$" for power in range(-30, 31, 7)), 0),
    ],
)
def test_ticks_of_a_logarithmic_axis(
    low: float, high: float, labels: tuple[str, ...], power: int
) -> None:
    ticks = log_ticks(low, high, 70.0, False)
    assert (ticks.labels, ticks.power) == (labels, power)


@pytest.mark.parametrize(
    ("length", "vertical", "least"),
    [(52.0, False, 2), (140.0, False, 3), (52.0, True, 3), (72.0, True, 3)],
)
def test_a_logarithmic_axis_can_be_read(length: float, vertical: bool, least: int) -> None:
    for ratio in np.geomspace(1.01, 1e40, 83):
        for low in np.geomspace(1e-8, 1e8, 31):
            for limits in ((low, low * ratio), (-low * ratio, -low)):
                places = np.array(log_ticks(*limits, length, vertical).places)
                assert len(places) >= least, limits
                room = 1e-8 * np.abs(limits)
                assert np.all((places >= limits[0] - room[0]) & (places <= limits[1] + room[1]))


@pytest.mark.parametrize("length", [52.0, 72.0, 140.0])
def test_labels_of_a_logarithmic_axis_keep_apart(length: float) -> None:
    """Matplotlib's own ticks of less than a decade are those of a linear axis, without room."""
    for ratio in np.geomspace(1.2, 40.0, 61):
        for low in np.geomspace(1e-8, 1e8, 31):
            ticks = log_ticks(low, low * ratio, length, vertical=False)
            at = np.log(ticks.places) * length / math.log(ratio)
            widths = np.array([text_width(label) for label in ticks.labels])
            assert np.all(np.diff(at) > 0.5 * (widths[1:] + widths[:-1])), (low, ratio)


def test_a_logarithmic_axis_has_no_labels_but_those_it_is_given() -> None:
    """Of less than a decade matplotlib would label 2, 3, 4 … times a power of ten between them."""
    sheet = Sheet(85.0, 40.0)
    axes = sheet.panel(13.0, 8.0, 69.0, 30.0)
    axes.set_xscale("log")
    axes.set_xlim(0.8, 6.0)
    ticks = log_ticks(0.8, 6.0, 69.0, vertical=False)
    label_axis(axes.xaxis, ticks, "t", "s")
    sheet.figure.canvas.draw()
    every = [*axes.get_xticklabels(), *axes.get_xticklabels(minor=True)]
    assert tuple(label.get_text() for label in every if label.get_text()) == ticks.labels
    assert axes.get_xlabel() == "t [s]"


def test_an_axis_without_labels_has_its_ticks_and_no_text() -> None:
    sheet = Sheet(85.0, 40.0)
    axes = sheet.panel(13.0, 8.0, 69.0, 30.0)
    axes.set_xlim(0.0, 3.0)
    ticks = number_ticks(0.0, 3.0, 69.0)
    label_axis(axes.xaxis, ticks, "t", "s", labelled=False)
    assert tuple(axes.get_xticks()) == ticks.places
    assert not any(label.get_text() for label in [*axes.get_xticklabels(), axes.xaxis.label])


def test_labels_of_numbers_keep_apart() -> None:
    for width in (10.0, 16.0, 30.0, 70.0):
        ticks = number_ticks(0.0, 3.0, width)
        assert ticks.places
        if len(ticks.places) > 1:
            step = (ticks.places[1] - ticks.places[0]) * width / 3.0
            assert step > 1.15 * max(map(len, ticks.labels))


@pytest.mark.parametrize(("low", "high"), [(-1234.5, 987.0), (0.0, 0.0123), (-0.31, -0.12)])
def test_labels_of_any_numbers_keep_apart_from_the_next(low: float, high: float) -> None:
    for width in (16.0, 30.0, 70.0):
        ticks = number_ticks(low, high, width)
        assert ticks.places
        for (place, label), (beside, other) in pairwise(
            zip(ticks.places, ticks.labels, strict=True)
        ):
            apart = (beside - place) * width / (high - low)
            assert apart > 0.575 * (len(label) + len(other))


@pytest.mark.parametrize(
    ("values", "labels"),
    [
        ((-2.0, 0.0, 2.0), ("−2", "0", "2")),
        ((-0.5, 0.0, 0.5), ("−0.5", "0.0", "0.5")),
        ((0.30000000000000004,), ("0.3",)),
        ((), ()),
    ],
)
def test_decimals(values: tuple[float, ...], labels: tuple[str, ...]) -> None:
    assert decimals(values) == labels


def test_long_numbers_get_a_power_of_ten() -> None:
    ticks = vertical_ticks(-0.0082, 0.0082, 50.0)
    assert ticks.power == -3
    assert ticks.labels == ("−7.5", "−5.0", "−2.5", "0.0", "2.5", "5.0", "7.5")
    assert vertical_ticks(-3.0, 3.0, 50.0).power == 0
    assert vertical_ticks(-3e6, 3e6, 50.0).power == 6


def test_a_fraction_keeps_its_decimals_where_fewer_labels_are_short_enough() -> None:
    """Not 652.5, 655.0, … in thousandths; the labels read as numbers give the places."""
    for low, high in ((0.6489, 0.6711), (0.9993, 1.0001)):
        ticks = vertical_ticks(low, high, 60.0)
        assert (ticks.power, ticks.offset) == (0, 0.0)
        assert len(ticks.places) >= 3
        assert [float(label) for label in ticks.labels] == pytest.approx(ticks.places, abs=1e-12)


def test_of_two_labels_in_conflict_the_one_nearer_to_its_edge_goes() -> None:
    first = Ticks((0.0, 0.99), ("0", "π/4"))
    second = Ticks((0.1, 0.5), ("−π/4", "0"))
    rows = [(0.0, 20.0, first), (21.0, 20.0, second)]
    kept = without_overlaps(rows, [(0.0, 1.0), (0.0, 1.0)])
    assert [ticks.labels for ticks in kept] == [("0", ""), ("−π/4", "0")]
    assert [ticks.places for ticks in kept] == [first.places, second.places]


def test_long_numbers_of_a_horizontal_axis_get_a_power_of_ten() -> None:
    small, large = number_ticks(-0.004, 0.002, 60.0), number_ticks(0.0, 4e6, 60.0)
    assert (small.power, large.power) == (-3, 6)
    assert "−4" in small.labels
    assert "4" in large.labels
    assert axis_words("s", "m", small) == "s [$10^{-3}$ m]"
    assert axis_words("s", "m", number_ticks(0.0, 4.0, 60.0)) == "s [m]"
    assert axis_words("share", "", large) == "share [$10^{6}$]"


@pytest.mark.parametrize("size", [1e-6, 1e-3, 0.02, 0.5, 1.0, 2e3, 5e4, 1e6])
def test_both_axes_of_a_plane_have_one_unit(size: float) -> None:
    """Places beside one another are read in the same powers of ten, and lie where they say."""
    for flat in (0.02, 0.1, 0.5, 1.0):
        across = number_ticks(-size, size, 60.0)
        along = vertical_ticks(-flat * size, flat * size, 60.0 * flat + 10.0)
        pair = in_one_unit(across, along)
        assert len({ticks.power for ticks in pair}) == 1
        for ticks, first in zip(pair, (across, along), strict=True):
            assert ticks.places == first.places
            said = [float(text.replace("−", "-")) * 10.0**ticks.power for text in ticks.labels]
            assert said == pytest.approx(ticks.places)
        axes = Sheet(85.0, 100.0).panel(12.0, 12.0, 60.0, 60.0 * flat + 10.0)
        plane_axes(axes, np.array([-size, -flat * size]), np.array([size, flat * size]))
        assert axes.get_xlabel().replace("x", "y") == axes.get_ylabel()


def test_impacts_are_counted_in_whole_numbers() -> None:
    for last in range(8, 60):
        places = number_ticks(0.5, last + 0.5, 60.0, whole=True).places
        assert len(places) > 1
        assert all(place == round(place) for place in places)


def test_no_tick_is_at_a_sixteenth_of_pi() -> None:
    ticks = angle_ticks(-1.4, -0.9, 120.0)
    assert not any("π" in label for label in ticks.labels)


@pytest.mark.parametrize("value", [1.0, -3.0e5, 211.3])
def test_limits_that_are_nearly_one_number_are_moved_apart(value: float) -> None:
    low, high = limits_apart(value, float(np.nextafter(value, np.inf)))
    assert high - low == pytest.approx(1e-9 * abs(value), rel=1e-5)
    assert low < value < high
    assert limits_apart(0.0, 1e-300) == (0.0, 1e-300)
    assert limits_apart(-1.0, 1.0) == (-1.0, 1.0)
    assert vertical_ticks(low, high, 40.0).places
    assert len(vertical_ticks(math.pi * value, math.pi * value, 40.0).places) <= 1


@pytest.mark.parametrize("ticked", [number_ticks, vertical_ticks])
@pytest.mark.parametrize("middle", [math.pi / 2, -211.30172973, 7.0e5])
@pytest.mark.parametrize("extent", [1e-4, 3e-6, 2e-8, 1e-9])
def test_labels_of_limits_near_one_another_count_from_a_number_between_them(
    ticked: Callable[[float, float, float], Ticks], middle: float, extent: float
) -> None:
    """The number in the name of the axis plus a label gives the position of the tick."""
    low, high = middle - 0.5 * extent * abs(middle), middle + 0.5 * extent * abs(middle)
    ticks = ticked(low, high, 60.0)
    assert len(set(ticks.labels)) == len(ticks.labels) >= 3
    assert max(map(len, ticks.labels)) <= 6
    found = re.fullmatch(
        r"s ([−+]) (\S+) \[(?:\$10\^\{(-?\d+)\}\$ )?m\]", axis_words("s", "m", ticks)
    )
    assert found is not None
    sign, offset, power = found.groups()
    shift = float(offset) if sign == "−" else -float(offset)
    for place, text in zip(ticks.places, ticks.labels, strict=True):
        read = shift + float(text.replace("−", "-")) * 10.0 ** int(power or 0)
        assert read == pytest.approx(place, abs=1e-6 * (high - low) + 4e-16 * abs(middle))


@pytest.mark.parametrize("power", range(-12, 13))
def test_a_round_number_is_not_above_and_there_is_one_just_below_a_power_of_ten(power: int) -> None:
    ten = float(f"1e{power}")
    below = round_below(math.nextafter(ten, 0.0))
    assert below < ten
    assert below == pytest.approx(0.5 * ten)
    for value, expected in ((1.001, 1.0), (1.999, 1.0), (2.001, 2.0), (4.999, 2.0), (5.001, 5.0)):
        assert round_below(value * ten) == pytest.approx(expected * ten)


@pytest.mark.parametrize("impacts", range(1, 8))
def test_each_of_few_impacts_has_its_number(impacts: int) -> None:
    axes = Figure().add_axes((0.1, 0.1, 0.8, 0.8))
    count_axis(axes, np.arange(1, impacts + 1))
    assert [text.get_text() for text in axes.get_xticklabels()] == [
        str(number) for number in range(1, impacts + 1)
    ]
    low, high = axes.get_xlim()
    assert low < 1.0 <= impacts < high


@pytest.mark.parametrize("values", [[1e-3, 7.0], [0.99, 1.01e5], [1e-30, 1e30]])
def test_a_logarithmic_axis_encloses_its_values_and_powers_of_ten(values: list[float]) -> None:
    axes = Figure().add_axes((0.1, 0.1, 0.8, 0.8))
    positive_axis(axes, np.array([*values, 0.0, np.nan]), "x", "m")
    low, high = axes.get_ylim()
    powers = axes.get_yticks()
    # There is room below the lowest power, for the numbers of the horizontal axis.
    assert low < min(powers) <= min(values)
    assert max(values) <= high
    assert max(powers) <= high
    assert len(powers) > 1
