"""Portraits without a run: what is drawn, by number, and that no text overlaps."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from tests.analysis.traces import BALL, circle, hump, landscape, line, system, three_arcs, valley
from tests.figures.layout import assert_texts_are_apart, texts
from tests.gallery import run_of
from vibro_cli.analysis.levels import Landscape, speed_curves
from vibro_cli.analysis.singular import FIGURE_EIGHT, SingularPoint, portrait_of
from vibro_cli.assemble import build_any
from vibro_cli.figures.labels import LEADER
from vibro_cli.figures.portraits import trace_phase_plane
from vibro_cli.figures.portraits.energies import energy_portrait
from vibro_cli.figures.portraits.layers import background, saddle_energies
from vibro_cli.figures.portraits.trace_phase_plane import (
    REST,
    behind_along,
    comparison,
    family,
    highest_energy,
    structure,
)
from vibro_cli.figures.style import MM
from vibro_cli.mechanics.potential import Turning
from vibro_cli.scenario import load_any

pytestmark = pytest.mark.long

SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios").glob("*.toml"))
WAVES = [valley(1.0, 50), hump(0.5, -50), valley(1.0, 50), hump(0.5, -50), valley(1.0, 90)]
SPINNING = Turning(0.0, 4.0)
HILLS = {
    "three arcs": three_arcs(),
    "open": three_arcs(60.0),
    "circle": circle(),
    "waves": landscape(-90, *WAVES),
    "line": landscape(-90, valley(1.0, 0), line(1.5), valley(1.0, 90)),
    "slope": landscape(-30, line(2.0)),
    "turning circle": Landscape.of(
        system(-180.0, valley(1.0, 180), closed=True, turning=SPINNING), 1
    ),
    "seam in the eight": Landscape.of(
        system(0.0, valley(1.0, 180), valley(1.0, 360), closed=True, turning=SPINNING), 1
    ),
}


def collections(figure: Figure, panel: int, zorder: float) -> list[Any]:
    return [
        segment
        for one in figure.axes[panel].collections
        if isinstance(one, LineCollection) and one.get_zorder() == zorder
        for segment in one.get_segments()
    ]


@pytest.mark.parametrize("name", HILLS)
def test_energy_is_constant_along_every_curve(name: str) -> None:
    """In both coordinates, to 1e-12 of the energy."""
    hills = HILLS[name]
    figure = structure(portrait_of(hills))
    pieces = hills.trace.pieces
    for panel, piece in enumerate(pieces):
        shift = piece.start_s if piece.is_line else 0.0
        for zorder in (1.0, 1.2, 1.25):
            for curve in collections(figure, panel, zorder):
                energy = hills.energy(piece, curve[:, 0] - shift, curve[:, 1])
                np.testing.assert_allclose(energy, energy[0], rtol=1e-12)
    below = len(pieces)
    for zorder in (1.0, 1.2, 1.25):
        for curve in collections(figure, below, zorder):
            count = len(curve) // 97
            inner = [curve[n * 97 + 1 : n * 97 + 96] for n in range(count)]
            energies = np.concatenate([_energies(hills, points) for points in inner])
            np.testing.assert_allclose(energies, energies[0], rtol=1e-12)


def _energies(hills: Landscape, points: Any) -> Any:
    middle = points[len(points) // 2, 0]
    piece = next(p for p in hills.trace.pieces if p.start_s <= middle <= p.start_s + p.length)
    along = points[:, 0] - piece.start_s
    place = along if piece.is_line else piece.angle_start + along / piece.radius
    return hills.energy(piece, place, points[:, 1] / hills.path_scale(piece))


def test_the_figure_eight_is_drawn_through_the_saddle_when_it_exists() -> None:
    hills = three_arcs()
    eights = [collections(structure(portrait_of(hills)), panel, 1.25) for panel in range(4)]
    assert all(eights)
    saddle = portrait_of(hills).points[1]
    for curve in eights[3]:
        assert np.min(np.hypot(curve[:, 0] - saddle.s, curve[:, 1])) < 0.02
    named = {text.get_text() for text in texts(structure(portrait_of(hills)))}
    assert "figure eight" in named
    assert "separatrix" not in named  # there is no other
    figure = structure(portrait_of(three_arcs(60.0)))
    assert not any(collections(figure, panel, 1.25) for panel in range(4))
    shown = " ".join(reversed([text.get_text() for text in texts(figure)]))
    assert "open separatrix" in shown
    assert "figure eight needs both" in shown


def test_a_figure_eight_over_the_seam_is_drawn_on_both_sides() -> None:
    figure = structure(portrait_of(HILLS["seam in the eight"]))
    left, right, along = (collections(figure, panel, 1.25) for panel in range(3))
    (one,), (other,) = left, right
    np.testing.assert_allclose(np.min(one[:, 0]), 0.0)
    np.testing.assert_allclose(np.max(other[:, 0]), 2.0 * np.pi)
    np.testing.assert_allclose(np.ptp(one[:, 0]), np.ptp(other[:, 0]), rtol=1e-6)
    assert len(along) == 2
    whole = collections(structure(portrait_of(HILLS["turning circle"])), 0, 1.25)
    assert max(np.max(curve[:, 0]) for curve in whole) == pytest.approx(np.max(one[:, 0]))


def test_a_separatrix_goes_through_a_saddle() -> None:
    """Of crests of unequal heights, in both coordinates."""
    path = Path(__file__).parents[2] / "scenarios" / "turning_five_arcs.toml"
    portrait = portrait_of(Landscape.of(build_any(load_any(path)), 1))
    saddles = np.array([point.s for point in portrait.points if point.kind == "saddle"])
    assert len(saddles) == 2
    curves = behind_along(portrait)
    drawn = [*curves.separatrices, *curves.eights]
    assert drawn
    for curve in drawn:
        assert np.any((saddles >= curve.position[0]) & (saddles <= curve.position[-1]))
    behind = background(
        portrait.landscape, portrait.landscape.trace.pieces, highest_energy(portrait)
    )
    crest = max(point.energy for point in portrait.points if point.kind == "saddle")
    (first, *_) = portrait.landscape.trace.pieces
    in_first = [part for part in behind.separatrices if part.piece == 0]
    assert in_first
    for part in in_first:  # the first valley is only on the curve through the higher crest
        energy = portrait.landscape.energy(first, part.position, part.rate)
        np.testing.assert_allclose(energy, crest, rtol=1e-9)


DESCENT = [line(1.0), valley(1.0, -10), hump(1.0, -30), line(2.0)]
WITHOUT_SADDLE = {
    "turning": Landscape.of(system(-90.0, *WAVES[:3], turning=Turning(-2.0, 5.0)), 1),
    "descent": landscape(-30, *DESCENT),
    "valley": landscape(-60, valley(1.0, 60)),
}


@pytest.mark.parametrize("name", WITHOUT_SADDLE)
def test_without_a_saddle_level_curves_pass_the_whole_trace(name: str) -> None:
    """One curve goes from end to end on every piece, and along the whole trace."""
    hills = WITHOUT_SADDLE[name]
    portrait = portrait_of(hills)
    assert not any(point.kind == "saddle" for point in portrait.points)
    figure = structure(portrait)
    spans = [
        (piece.start_s, piece.start_s + piece.length)
        if piece.is_line
        else (piece.angle_start, piece.angle_end)
        for piece in hills.trace.pieces
    ]
    for panel, (low, high) in enumerate([*spans, (0.0, hills.trace.length)]):
        curves = collections(figure, panel, 1.0)
        passing = [c for c in curves if np.allclose([c[0, 0], c[-1, 0]], [low, high], atol=1e-9)]
        assert passing, panel


@pytest.mark.parametrize("width", ["single", "double"])
def test_a_long_type_fits_over_its_panel(width: str) -> None:
    path = Path(__file__).parents[2] / "scenarios" / "turning_valley.toml"
    portrait = portrait_of(Landscape.of(build_any(load_any(path)), 1))
    figure = family([("3.8", portrait), ("again", portrait)], width)
    assert_texts_are_apart(figure)
    shown = {text.get_text() for text in texts(figure)}
    assert "C1, S1, C2, S2, C3, S3, C4; open, figure eight, open" in shown


def test_points_have_names_beside_them_and_values_above() -> None:
    figure = structure(portrait_of(three_arcs()))
    shown = [text.get_text() for text in texts(figure)]
    assert {"C1", "S1", "C2"} <= set(shown)
    assert "C1 0 m, S1 0.5358 m, C2 0 m" in " ".join(reversed(shown))
    below = figure.axes[3]
    assert (below.get_xlabel(), below.get_ylabel()) == ("$s$ [m]", "$v$ [m/s]")


@pytest.mark.parametrize("width", ["single", "double"])
@pytest.mark.parametrize(("unit", "power"), [(1e-6, -7), (1e6, 5)])
def test_heights_are_in_powers_of_ten_on_very_small_and_large_traces(
    unit: float, power: int, width: str
) -> None:
    """They used to be written as 7.019e-07, one with a minus and one with a hyphen."""
    arcs = [valley(unit, 50.0), hump(0.5 * unit, -50.0), valley(unit, 80.0)]
    body = replace(BALL, radius=0.1 * unit)
    figure = structure(portrait_of(landscape(-80.0, *arcs, body=body)), width)
    shown = " ".join(text.get_text() for text in texts(figure))
    assert rf"\times10^{{{power}}}$ m".replace("-", "−") in shown.replace("-", "−")
    assert re.search(r"\de[+−-]", shown) is None
    assert_texts_are_apart(figure)


@pytest.mark.parametrize("width", ["single", "double"])
@pytest.mark.parametrize("name", HILLS)
def test_no_text_is_cut_off_or_overlaps_another(name: str, width: str) -> None:
    assert_texts_are_apart(structure(portrait_of(HILLS[name]), width))


@pytest.mark.parametrize("width", ["single", "double"])
@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_the_gallery_has_portraits(path: Path, width: str) -> None:
    system = build_any(load_any(path))
    for ball in range(1, len(system.bodies) + 1):
        portrait = portrait_of(Landscape.of(system, ball))
        assert_texts_are_apart(structure(portrait, width, str(ball)))


@pytest.mark.parametrize("width", ["single", "double"])
@pytest.mark.parametrize("number", [1, 2, 5, 30])
def test_a_family_has_a_panel_for_each_member(number: int, width: str) -> None:
    members = [(f"r = {n}", portrait_of(three_arcs(60.0 + n))) for n in range(number)]
    figure = family(members, width)
    assert len(figure.axes) == (number if number <= 12 else 10)
    assert_texts_are_apart(figure)


@pytest.mark.parametrize("rate", [3.5, 4.5, 5.5])
def test_names_of_a_family_belong_to_their_points(rate: float) -> None:
    """Inside the frame, beside the point or with a line to it; the legend says what is drawn."""
    path = Path(__file__).parents[2] / "scenarios" / "turning_valley.toml"
    scenario = load_any(path, [f"trace.turning.rate={rate}"])
    portrait = portrait_of(Landscape.of(build_any(scenario), 1))
    figure = family([("fast", portrait)], "double")
    assert_texts_are_apart(figure)
    eight = ["figure eight"] if rate == 3.5 else []
    (legend,) = figure.legends
    shown = [text.get_text() for text in legend.get_texts()]
    assert shown == [*eight, "separatrix", "level", "centre", "saddle"]
    (axes,) = figure.axes
    places = dict(zip(portrait.names, (point.s for point in portrait.points), strict=True))
    names = {text.get_text(): text for text in axes.texts}
    assert names.keys() == places.keys()
    leaders = [np.asarray(line.get_xydata()) for line in axes.lines if line.zorder == 4.5]
    tied = np.concatenate([np.zeros((0, 2)), *(ends[1:] for ends in leaders)])
    for name, text in names.items():
        assert axes.bbox.contains(*text.get_window_extent().min)
        assert axes.bbox.contains(*text.get_window_extent().max)
        point = np.array([places[name], 0.0])
        reach = axes.transData.transform(point) - axes.transData.transform(text.get_position())
        near = np.hypot(*reach) / figure.dpi < LEADER * MM * 1.001
        assert near or np.any(np.all(np.isclose(tied, point, atol=1e-9), axis=1))


def test_an_empty_family_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one"):
        family([])


def test_a_level_piece_of_the_trace_is_named_where_it_is_drawn() -> None:
    """The text gives its value under that name."""
    figure = structure(portrait_of(HILLS["line"]))
    assert "line of equilibria" in {text.get_text() for text in texts(figure)}
    (name,) = (text for text in texts(figure) if text.get_text() == "D1")
    assert name.axes is not None
    at_rest = name.axes.transData.transform((0.0, 0.0))[1]
    low, high = name.get_window_extent().intervaly
    assert not low <= at_rest <= high  # beside the line, not over it


def test_a_level_piece_is_drawn_on_its_own_panel_and_along_the_trace() -> None:
    """As long as it is, from where it begins; on its panel alone of those of the pieces."""
    hills = HILLS["line"]
    figure = structure(portrait_of(hills))
    drawn = [
        (number, np.asarray(one.get_xdata()))
        for number, axes in enumerate(figure.axes)
        for one in axes.lines
        if one.get_linewidth() == REST["linewidth"] and one.get_color() == REST["color"]
    ]
    level = hills.trace.pieces[1]
    assert [number for number, _ in drawn] == [level.index, len(figure.axes) - 1]
    for _, ends in drawn:
        assert ends == pytest.approx([0.5 * math.pi, 0.5 * math.pi + 1.5], abs=1e-12)


def test_separatrices_of_very_many_heights_leave_room_between_them() -> None:
    """Drawn as wide as usual, those of 60 saddles covered more of their panel than they left."""
    slopes = [30 + 8 * math.sin(2.3 * n) for n in range(60)]  # the slopes make the heights differ
    waves = [shape for s in slopes for shape in (valley(1.0, s), hump(0.5, 0.9 * s - 62.0))]
    hills = landscape(-60, *waves, valley(1.0, 60))
    portrait = portrait_of(hills)
    assert len(saddle_energies(portrait.points)) == 60
    figure = structure(portrait, "double")
    axes = figure.axes[-1]
    inked = 0.0
    for drawn in axes.collections:
        assert isinstance(drawn, LineCollection)
        pixels = map(axes.transData.transform, drawn.get_segments())
        length = sum(np.hypot(*np.diff(curve, axis=0).T).sum() for curve in pixels)
        inked += length * float(np.max(drawn.get_linewidth())) * figure.dpi / 72.0
    box = axes.get_window_extent()
    assert inked < 0.3 * box.width * box.height
    assert collections(figure, -1, 1.0)  # the level curves that the legend names
    assert_texts_are_apart(figure)


@pytest.mark.parametrize("width", ["single", "double"])
def test_portraits_of_very_many_arcs_fit_a_page(width: str) -> None:
    """Of 201 arcs they were one and a half metres long, with a tangle of 200 names."""
    waves = [valley(1.0, 50), hump(0.5, -50)] * 100
    hills = landscape(-50, *waves, valley(1.0, 50))
    portrait = portrait_of(hills)
    assert len(portrait.points) == 201
    for figure in (structure(portrait, width), comparison([("ball", portrait)], width)):
        assert figure.get_size_inches()[1] / MM <= 290.0
        (words,) = (one.get_text() for one in texts(figure) if " of 201" in one.get_text())
        titles = [one.get_title() for one in figure.axes if one.get_title()]
        assert words == f"arcs 1–{len(titles)} of 201"
        assert [title.split(",")[0] for title in titles] == list(
            map(str, range(1, len(titles) + 1))
        )
    names = [one.get_text() for one in texts(structure(portrait, width))]
    assert sum(bool(re.fullmatch(r"[CS]\d+", name)) for name in names) < 60
    assert_texts_are_apart(structure(portrait, width))


def test_saddles_are_not_compared_with_one_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each was looked for among those of figure eights: 3.4 million comparisons for 3,001 arcs."""
    crests = [arc for n in range(200) for arc in (valley(1.0, 30 + n % 7), hump(1.0, -30 - n % 7))]
    portrait = portrait_of(landscape(-120.0, *crests, valley(1.0, 120)))
    compared: list[object] = []
    equal = SingularPoint.__eq__

    def counted(one: SingularPoint, other: object) -> bool:
        compared.append(other)
        return equal(one, other)

    monkeypatch.setattr(SingularPoint, "__eq__", counted)
    behind = behind_along(portrait, 3)
    assert len(compared) <= len(portrait.points)
    eights = [one for one in portrait.triggers if one.orbit == FIGURE_EIGHT]
    assert len(behind.eights) == len({one.turning_left for one in eights}) > 0


def test_both_widths_of_a_figure_share_the_curves_along_the_trace(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They were computed again for the second width, half of its time on many arcs."""
    asked: list[float] = []

    def counted(
        hills: Landscape, count: int, energy: float, saddles: Any = None, *, shown: Any
    ) -> Any:
        asked.append(energy)
        return speed_curves(hills, count, energy, saddles, shown)

    monkeypatch.setattr(trace_phase_plane, "speed_curves", counted)
    run = run_of("three_arcs", "stop.collisions=3", "balls[1].radius=0.0987")
    drawn = [energy_portrait(run, 1, width) for width in ("double", "single")]
    assert len(asked) == len(set(asked)) > 0
    wide, narrow = (collections(figure, 0, 1.0) for figure in drawn)
    assert len(wide) == len(narrow) > 0
    assert all(map(np.array_equal, wide, narrow))


def test_curves_along_a_close_up_are_those_on_its_pieces() -> None:
    """Those on all of 1,001 arcs took 1.7 GB; even of those, 97 points on each are too many."""
    radii = [0.4 + 0.001 * n for n in range(60)]
    rising = [arc for radius in radii for arc in (valley(1.0, 50), hump(radius, -50))]
    portrait = portrait_of(landscape(-50.0, *rising))
    pieces, shown = portrait.landscape.trace.pieces, range(20, 25)
    low, high = pieces[20].start_s, pieces[25].start_s
    close, whole = behind_along(portrait, shown=shown), behind_along(portrait)
    for name in ("levels", "separatrices"):
        drawn, all_along = getattr(close, name), getattr(whole, name)
        assert max(len(curve.position) for curve in drawn) <= 97 * len(shown)
        assert max(len(curve.position) for curve in all_along) <= 4000
        crossing = [
            curve for curve in all_along
            if np.any((curve.position > low) & (curve.position < high))
        ]  # fmt: skip
        assert len(drawn) == len(crossing) > 0
        for one, other in zip(drawn, crossing, strict=True):
            assert low - 1e-9 <= one.position[0] < one.position[-1] <= high + 1e-9
            inside = (other.position > one.position[0]) & (other.position < one.position[-1])
            rate = np.interp(other.position[inside], one.position, one.rate)
            np.testing.assert_allclose(rate**2, other.rate[inside] ** 2, atol=0.02)
