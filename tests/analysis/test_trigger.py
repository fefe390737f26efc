"""The trigger of coupled singular points and the condition of the figure eight, model §7."""

from __future__ import annotations

import math
from bisect import bisect
from dataclasses import replace

import numpy as np
import pytest

from tests.analysis.traces import (
    BALL,
    DEGREE,
    circle,
    hump,
    landscape,
    line,
    three_arcs,
    valley,
)
from tests.bare_system import GRAVITY
from vibro_cli.analysis import levels
from vibro_cli.analysis.levels import Landscape, Reach, reaches
from vibro_cli.analysis.singular import FIGURE_EIGHT, HETEROCLINIC, OPEN, triggers
from vibro_cli.mechanics.trace import Piece

WEIGHT = BALL.mass * GRAVITY


def threshold(radius: float) -> float:
    """Outer slope (degrees) at which (R − r)(1 − cos θ) = (R + R₀)(1 − cos J)."""
    return math.acos(1 - 1.5 * (1 - math.cos(50 * DEGREE)) / (1 - radius)) / DEGREE


def test_three_arcs_have_one_trigger_with_its_energies() -> None:
    (trigger,) = triggers(three_arcs())
    assert (trigger.left.piece, trigger.saddle.piece, trigger.right.piece) == (0, 1, 2)
    crest = 1.5 * (1 - math.cos(50 * DEGREE))
    end = 0.9 * (1 - math.cos(120 * DEGREE))
    assert trigger.saddle.energy == pytest.approx(WEIGHT * crest, rel=1e-14)
    assert trigger.margin_left == pytest.approx(WEIGHT * (end - crest), rel=1e-14)
    assert trigger.margin_right == pytest.approx(WEIGHT * (end - crest), rel=1e-14)
    # the separatrix turns where (R − r)(1 − cos θ) = (R + R₀)(1 − cos J), R = 1
    turn = threshold(0.1) * DEGREE
    assert trigger.orbit == FIGURE_EIGHT
    assert trigger.turning_left == pytest.approx(120 * DEGREE - turn, rel=1e-13)
    assert trigger.turning_right == pytest.approx((170 + 0.5 * 100 + 50) * DEGREE + turn, rel=1e-13)


@pytest.mark.parametrize("radius", [0.0, 0.05, 0.2])
@pytest.mark.parametrize("inertia_ratio", [0.0, 0.4, 1.0])
def test_figure_eight_exists_on_one_side_of_its_threshold(
    radius: float, inertia_ratio: float
) -> None:
    """The condition depends on r and not on κ."""
    body = replace(BALL, kind="custom", radius=radius, inertia_ratio=inertia_ratio)
    (beyond,) = triggers(three_arcs(threshold(radius) + 1e-6, body))
    (short,) = triggers(three_arcs(threshold(radius) - 1e-6, body))
    assert beyond.orbit == FIGURE_EIGHT
    assert beyond.margin_left > 0.0
    assert short.orbit == OPEN
    assert short.margin_left < 0.0
    assert (short.turning_left, short.turning_right) == (None, None)


def test_both_sides_must_close() -> None:
    hills = landscape(-120.0, valley(1.0, 50), hump(0.5, -50), valley(1.0, 60))
    (trigger,) = triggers(hills)
    assert trigger.turning_left is not None
    assert trigger.turning_right is None
    assert trigger.orbit == OPEN


def test_equal_crests_are_joined_by_a_heteroclinic_orbit() -> None:
    arcs = (valley(1.0, 50), hump(0.5, -50), valley(1.0, 50), hump(0.5, -50), valley(1.0, 120))
    first, second = triggers(landscape(-120.0, *arcs))
    assert first.orbit == second.orbit == HETEROCLINIC
    assert first.margin_right == pytest.approx(
        WEIGHT * (0.9 * 1.5 - 1.5 * (1 - math.cos(50 * DEGREE))), rel=1e-13
    )


@pytest.mark.parametrize("left", [30, 120])
@pytest.mark.parametrize("right", [30, 120])
def test_a_separatrix_between_equal_crests_is_no_eight(left: float, right: float) -> None:
    """Where only one outer side closes, that crest was said to have an eight of its own.

    An outer valley up to 30 degrees is lower than the crests, one up to 120 degrees is higher.
    """
    between = (valley(1.0, 50), hump(0.5, -50), valley(1.0, 50), hump(0.5, -50))
    first, second = triggers(landscape(-left, *between, valley(1.0, right)))
    assert first.orbit == (OPEN if left == 30 else HETEROCLINIC)
    assert second.orbit == (OPEN if right == 30 else HETEROCLINIC)
    # Beyond the other crest the level runs on, to its turning point if there is one.
    assert first.turning_right is not None
    assert second.turning_left is not None
    if right == 30:
        assert first.turning_right == pytest.approx(second.saddle.s, rel=1e-15)
    if left == 30:
        assert second.turning_left == pytest.approx(first.saddle.s, rel=1e-15)


def asked_pieces(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list that receives the piece of each search for accessible parts."""
    asked: list[int] = []

    def counted(trace: Landscape, piece: Piece, energy: float) -> tuple[Reach, ...]:
        asked.append(piece.index)
        return reaches(trace, piece, energy)

    monkeypatch.setattr(levels, "reaches", counted)
    return asked


def height_at(trace: Landscape, place: float) -> float:
    """Return the height (m) of a body at a place of the path of its point of contact."""
    piece = next(p for p in reversed(trace.trace.pieces) if p.start_s <= place)
    return float(trace.height(piece, piece.angle_start + (place - piece.start_s) / piece.radius))


def test_the_level_through_equal_crests_is_found_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was found again for each: 1,000 crests took the time of a million pieces, 7 s."""
    between = [hump(0.5, -50), valley(1.0, 50)]
    hills = landscape(-120.0, valley(1.0, 50), *between * 19, hump(0.5, -50), valley(1.0, 120))
    asked = asked_pieces(monkeypatch)
    assert [trigger.orbit for trigger in triggers(hills)] == 20 * [HETEROCLINIC]
    assert asked == list(range(41))


def test_the_levels_of_unequal_crests_are_followed_only_to_their_turning_points(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each was sought on the whole trace: a portrait of 2,000 unequal crests took 46 s."""
    ends = [30.0 + 37.0 * n % 29.0 for n in range(200)]
    crests = [arc for end in ends for arc in (valley(1.0, end), hump(0.5, -end))]
    hills = landscape(-120.0, *crests, valley(1.0, 120))
    asked = asked_pieces(monkeypatch)
    found = triggers(hills)
    assert len(found) == 200
    assert len(asked) < 0.1 * len(found) * len(hills.trace.pieces)
    places = np.array([one.saddle.s for one in found])
    energies = np.array([one.saddle.energy for one in found])
    for one in found:
        assert one.turning_left is not None
        assert one.turning_right is not None
        # Only lower crests, and those as high as its own, lie between; the next ones are higher.
        inside = (one.turning_left < places) & (places < one.turning_right)
        assert np.max(energies[inside]) == pytest.approx(one.saddle.energy, rel=1e-13)
        first, last = np.flatnonzero(inside)[[0, -1]]
        outer = np.pad(energies, 1, constant_values=math.inf)[[first, last + 2]]
        assert np.min(outer) > one.saddle.energy


def test_a_level_is_not_followed_through_a_higher_crest(monkeypatch: pytest.MonkeyPatch) -> None:
    """It ran on beyond it, through almost half of 1,000 random crests, as both flanks have it."""
    slopes = np.random.default_rng(3).uniform(10.0, 60.0, 300).tolist()
    crests = [arc for slope in slopes for arc in (valley(1.0, slope), hump(1.0, -slope))]
    hills = landscape(-100.0, *crests, valley(1.0, 120))
    asked = asked_pieces(monkeypatch)
    found = triggers(hills)
    monkeypatch.undo()
    starts = [piece.start_s for piece in hills.trace.pieces]
    places, energies = zip(*((one.saddle.s, one.saddle.energy) for one in found), strict=True)
    followed = 0
    for one in found:  # the first places to both sides where the trace is as high as the crest
        energy = one.saddle.energy
        turning = np.array([one.turning_left, one.turning_right], dtype=float).tolist()
        first, last = (bisect(starts, place) for place in turning)
        followed += last - first + 1
        assert max(energies[slice(*(bisect(places, place) for place in turning))]) == energy
        for place in turning:
            assert height_at(hills, place) == pytest.approx(energy / WEIGHT, rel=1e-12)
    for one in found[::10]:  # on the whole trace, the level through a crest is that at its place
        whole = levels.speed_curves(hills, 9, one.saddle.energy)
        (curve,) = (c for c in whole if c.position[0] < one.saddle.s < c.position[-1])
        (own,) = levels.speed_curves(hills, 9, one.saddle.energy, [one.saddle.s])
        assert np.array_equal(own.position, curve.position)
        assert np.array_equal(own.rate, curve.rate)
        assert (one.turning_left, one.turning_right) == (curve.position[0], curve.position[-1])
    assert len(found) == 300
    assert len(asked) <= followed + 2 * len(found)  # beside a level only the pieces next to it


def test_a_level_passes_lower_crests_without_a_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each piece was searched for each level: crests that rise all the way took quadratic time."""
    crests = [valley(1.0, 50), hump(0.5, -45)] * 200
    hills = landscape(-120.0, *crests, valley(1.0, 120))
    asked = asked_pieces(monkeypatch)
    found = triggers(hills)
    assert len(found) == 200
    assert len(asked) <= 8 * len(found)
    monkeypatch.undo()
    for one in found[9::38]:  # on the whole trace, the level through a crest is that at its place
        energy, s = one.saddle.energy, one.saddle.s
        whole = levels.speed_curves(hills, 9, energy)
        (curve,) = (c for c in whole if c.position[0] < s < c.position[-1])
        (own,) = levels.speed_curves(hills, 9, energy, [s])
        assert np.array_equal(own.position, curve.position)
        assert np.array_equal(own.rate, curve.rate)
        # Its energy is that of the crest: m g y + κ m v²/2.
        for place, speed in zip(own.position[1:-1:9], own.rate[1:-1:9], strict=True):
            fall = 0.5 * 1.4 * speed**2 / GRAVITY
            assert height_at(hills, place) + fall == pytest.approx(energy / WEIGHT, rel=1e-12)


def test_a_separatrix_among_equal_crests_runs_to_the_nearest() -> None:
    crests = (valley(1.0, 50), hump(0.5, -50)) * 4
    found = triggers(landscape(-30.0, *crests, valley(1.0, 30)))
    places = [one.saddle.s for one in found]
    assert [one.turning_right for one in found] == [*places[1:], None]
    assert [one.turning_left for one in found] == [None, *places[:-1]]


@pytest.mark.parametrize("seam", range(9))
def test_equal_crests_with_a_higher_one_on_either_side_have_an_eight_each(seam: int) -> None:
    """Three crests on the floor of a closed trace, the middle one higher; the fourth is its top."""
    low, high = 30.0, 50.0
    floor = (valley(1.0, low), hump(1.0, -low), valley(1.0, high), hump(1.0, -high),
             valley(1.0, low), hump(1.0, -low), valley(1.0, 90))  # fmt: skip
    half = 1.0 + 4 * math.sin(low * DEGREE) + 2 * math.sin(high * DEGREE)
    arcs = [*floor, valley(half, 180), valley(half, 270)]
    slopes = [-90.0, low, -low, high, -high, low, -low, 90.0, 180.0]
    ends = [arc.end_slope + 2.0 * math.pi for arc in arcs[:seam] if arc.end_slope is not None]
    later = [replace(arc, end_slope=end) for arc, end in zip(arcs, ends, strict=False)]
    hills = landscape(slopes[seam], *arcs[seam:], *later, closed=True)
    assert hills.trace.closing_error()[0] < 1e-13
    found = sorted(triggers(hills), key=lambda trigger: trigger.saddle.energy)
    assert [one.orbit for one in found] == [FIGURE_EIGHT] * 3 + [OPEN]
    assert found[0].saddle.energy == pytest.approx(found[1].saddle.energy, rel=1e-13)
    assert found[1].saddle.energy < 0.5 * found[2].saddle.energy


def test_equal_crests_without_a_higher_one_between_are_joined_on_a_closed_trace() -> None:
    arcs = (valley(1.0, 30), hump(1.0, -30), valley(1.0, 30), hump(1.0, -30), valley(1.0, 90))
    half = 1.0 + 4 * math.sin(30 * DEGREE)
    hills = landscape(-90.0, *arcs, valley(half, 180), valley(half, 270), closed=True)
    first, second, top = triggers(hills)
    assert first.orbit == second.orbit == HETEROCLINIC
    assert top.orbit == OPEN


def test_lower_crest_has_its_eight_within_the_higher_one() -> None:
    arcs = (valley(1.0, 60), hump(0.5, -60), valley(1.0, 40), hump(0.5, -40), valley(1.0, 120))
    high, low = triggers(landscape(-120.0, *arcs))
    assert low.saddle.energy < high.saddle.energy
    assert low.orbit == FIGURE_EIGHT
    assert low.turning_left is not None
    assert low.turning_left > high.saddle.s


def test_circle_has_no_trigger() -> None:
    """Its saddle lies between the only centre and the same centre again."""
    assert triggers(circle()) == ()


def test_level_line_between_valleys_is_no_trigger() -> None:
    assert triggers(landscape(-60.0, valley(1.0, 0), line(2.0), valley(1.0, 60))) == ()


def test_closed_trace_finds_neighbours_across_the_seam() -> None:
    """Two valleys with a crest between, closed over the top by an arc of radius 2.3."""
    arcs = (valley(1.0, 60), hump(0.3, -60), valley(1.0, 60), valley(2.3, 300))
    hills = landscape(-60.0, *arcs, closed=True)
    assert hills.trace.closing_error()[0] < 1e-14
    crest, top = triggers(hills)
    assert (crest.saddle.piece, crest.saddle.position) == (1, 0.0)
    assert crest.saddle.energy == pytest.approx(WEIGHT * 1.3 * 0.5, rel=1e-14)
    assert crest.orbit == FIGURE_EIGHT
    assert crest.turning_left is not None
    assert crest.turning_right is not None
    assert crest.turning_left > top.saddle.s > crest.turning_right  # beyond the seam
    assert crest.margin_left == pytest.approx(top.saddle.energy - crest.saddle.energy, rel=1e-14)
    assert (top.saddle.piece, top.orbit) == (3, OPEN)
