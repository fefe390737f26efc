"""Numbers beside points: inside the panel, and clear of one another and of the drawing."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from vibro_cli.figures.labels import HEIGHT_REACHED, Named, place_numbers, write_names
from vibro_cli.figures.source import Array

SIZE = (60.0, 50.0)
NOTHING = np.empty((0, 2))


def placed(
    texts: list[str], anchors: list[Array], obstacles: Array = NOTHING
) -> list[tuple[float, float]]:
    """Return the position of each text; every one has room."""
    places = [place for place in place_numbers(texts, anchors, obstacles, SIZE) if place]
    assert len(places) == len(texts)
    return places


def test_number_stands_close_to_its_point() -> None:
    ((x, y),) = placed(["1"], [np.array([[30.0, 25.0]])])
    assert 1.0 < np.hypot(x - 30.0, y - 25.0) < 3.5


def test_number_keeps_off_curves() -> None:
    """Between a curve above and one at its right the free side is found, however they are drawn."""
    line = np.linspace(0.0, 60.0, 600)
    above = np.column_stack([line, np.full(600, 26.5)])
    right = np.column_stack([np.full(600, 31.5), line])
    drawn = np.concatenate([above, right])
    for order in (np.arange(1200), np.random.default_rng(1).permutation(1200)):
        ((x, y),) = placed(["1"], [np.array([[30.0, 25.0]])], drawn[order])
        assert x < 31.0
        assert y < 25.5


def test_numbers_stay_in_the_panel_and_apart() -> None:
    corner = [np.array([[0.3, 0.3]]), np.array([[0.4, 0.6]]), np.array([[59.9, 49.9]])]
    places = placed(["1", "2", "12"], corner)
    for x, y in places:
        assert 0.0 < x < SIZE[0]
        assert 0.0 < y < SIZE[1]
    (ax, ay), (bx, by), _ = places
    assert abs(ax - bx) > 1.3 or abs(ay - by) > 2.0


def test_number_stands_nearer_to_its_own_point() -> None:
    points = [np.array([[30.0, 25.0]]), np.array([[33.0, 25.0]])]
    for number, (x, y) in enumerate(placed(["1", "2"], points)):
        own, other = points[number][0], points[1 - number][0]
        assert np.hypot(x - own[0], y - own[1]) < np.hypot(x - other[0], y - other[1])


def test_numbers_without_room_are_left_out() -> None:
    """Of 200 on one point, those that are placed are apart; before, they stood on one another."""
    middle = [np.array([[30.0, 25.0]])] * 200
    places = [place for place in place_numbers(["88"] * 200, middle, NOTHING, SIZE) if place]
    assert 10 < len(places) < 100
    for number, (x, y) in enumerate(places):
        for u, v in places[:number]:
            assert abs(x - u) > 2.5 or abs(y - v) >= 2.5
    axes = Figure((2.0, 2.0)).add_axes((0.0, 0.0, 1.0, 1.0))
    write_names(axes, [Named("88", (0.5, 0.5))] * 200, NOTHING)
    assert 10 < len(axes.texts) < 100


def test_what_is_higher_than_numbers_reach_does_not_move_them() -> None:
    """Numbers on a point in a dense band stand beyond it, the first one as far as any can."""
    middle = [np.array([[30.0, 25.0]])] * 40
    curves = np.random.default_rng(1).uniform((0.0, 0.0), SIZE, (5000, 2))
    band = np.random.default_rng(2).uniform((0.0, 19.0), (60.0, 31.0), (100_000, 2))
    curves = np.concatenate([curves, band])
    near = curves[np.abs(curves[:, 1] - 25.0) < HEIGHT_REACHED]
    places = placed(["8"], middle[:1], near)
    assert abs(places[0][1] - 25.0) + 1.25 == pytest.approx(HEIGHT_REACHED)
    assert placed(["8"], middle[:1], curves) == places
    every = place_numbers(["8"] * 40, middle, curves, SIZE)
    assert place_numbers(["8"] * 40, middle, near, SIZE) == every
