"""Every point of every curve that is drawn lies where the energy of its motion puts it.

Judged on the artists themselves: the ends and the middles of every straight part of every curve,
against energies that are computed here from masses, heights and springs. A point is on its level
when the level passes within a line's width of it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tests.figures.energy import on_spring, on_trace
from tests.gallery import run_of
from vibro_cli.figures.film import Film, frame_times
from vibro_cli.figures.portraits.energies import energy_portrait
from vibro_cli.figures.portraits.portrait import phase_portrait
from vibro_cli.figures.runs.over_time import energies
from vibro_cli.figures.style import MM
from vibro_cli.systems.springs.figures import springs_energies
from vibro_cli.systems.springs.portrait import springs_portrait, springs_structure
from vibro_cli.systems.table.figures import table_energies
from vibro_cli.systems.table.plan import table_plan
from vibro_cli.systems.trace.figures import film as film_on_trace

pytestmark = pytest.mark.long

Array = NDArray[np.float64]
LINE = 0.3
"""A line's width (mm): 0.9 pt."""
MOST = 500
"""Branches of a panel that are judged, evenly among all."""
TEN, MANY = ("stop.collisions=10",), ("stop.collisions=10000", "stop.time=1e7", "collision.k=1")
TRACES = [
    ("three_arcs", TEN), ("three_arcs", MANY), ("one_circle", TEN), ("one_circle", MANY),
    ("closed_three_balls", TEN), ("closed_three_balls", MANY), ("five_balls", MANY),
    ("line_between_valleys", TEN), ("turning_circle", TEN), ("turning_circle", MANY),
    ("turning_five_arcs", TEN), ("turning_five_arcs", MANY), ("unequal_normal_impulse", ()),
    ("one_circle", ("stop.time=4000",)), ("lone_particle", ()),
]  # fmt: skip
SPRINGS = [
    ("two_disks", TEN), ("two_disks", MANY), ("two_disks", ("stop.time=6000",)),
    ("stressed_at_rest", TEN), ("stressed_at_rest", MANY), ("stressed_at_rest", ()),
    ("stressed_at_rest", ("collision.k=0", "stop.time=500")),
]  # fmt: skip

TABLES = [
    ("elliptic_wall", ("wall.k=1", "stop.bounces=10")), ("elliptic_wall", ()),
    ("elliptic_wall", ("wall.k=1", "stop.bounces=10000")),
    ("billiards", ("collision.k=1", "wall.k=1", "stop={collisions=10}")),
    ("billiards", ("collision.k=1", "wall.k=1", "stop={collisions=10000}")),
    ("skew_impact", ()),
]  # fmt: skip


def points_of(line: Array) -> Array:
    """Return the ends and the middles of the straight parts of a curve."""
    return np.concatenate([line, 0.5 * (line[1:] + line[:-1])])


def scale_of(axes: Axes) -> Array:
    """Return the width of a line along both axes."""
    figure: Any = axes.get_figure(root=True)
    box = axes.get_position()
    size = np.array([box.width, box.height]) * figure.get_size_inches() / MM
    width: Array = LINE * np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())]) / size
    return width


def assert_on_level(
    points: Array, level: Array | float, energy: Callable[[Array, Array], Array], width: Array
) -> None:
    """Check that every point is within a line's width of a point of the level."""
    turn = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    around = [np.zeros(2), *np.column_stack([np.cos(turn), np.sin(turn)])]
    near = np.array([energy(*(points + width * step).T) for step in around])
    rounding = 1e-9 * np.max(np.abs(near), initial=1.0)
    inside = (near.min(axis=0) - rounding <= level) & (level <= near.max(axis=0) + rounding)
    assert np.all(inside), (points[~inside][:3], level)


def branches_of(axes: Axes) -> list[LineCollection]:
    """The collections of branches of a panel; those of lasting contact come last."""
    return [
        one
        for one in axes.collections
        if isinstance(one, LineCollection) and one.get_zorder() == 2.0
    ]


def arc_of(figure: Figure, axes: Axes) -> int:
    """Return the number of the arc that a panel shows."""
    for one in (axes, figure.axes[0]):
        found = re.search(r"\d+", one.get_title())
        if found:
            return int(found[0])
    raise AssertionError("no panel is named")


@pytest.mark.parametrize(("name", "overrides"), TRACES)
def test_branches_of_a_trace_are_on_their_levels(name: str, overrides: tuple[str, ...]) -> None:
    run = run_of(name, *overrides)
    flights = run.flights()
    drawn = 0
    for ball in (1, len(run.system.bodies)):
        figure = phase_portrait(run, ball)
        for axes in figure.axes:
            if not branches_of(axes):
                continue
            arc = arc_of(figure, axes)
            piece = run.system.trace.pieces[arc - 1]
            shift = piece.start_s if piece.shape == "line" else 0.0
            mine = (flights["ball"] == ball) & (flights["arc"] == arc) & ~flights["contact"]

            def energy(place: Array, rate: Array, ball: int = ball, arc: int = arc,
                       shift: float = shift) -> Array:  # fmt: skip
                return on_trace(run.system, ball, arc, place - shift, rate)

            start, begins = flights["t_start"][mine], flights["angle_start"][mine] + shift
            levels = energy(begins, flights["rate_start"][mine])
            drawn += _check(axes, start, levels, energy)
    assert drawn > 0


@pytest.mark.parametrize(("name", "overrides"), TRACES)
def test_branches_over_the_arc_length_are_on_their_levels(
    name: str, overrides: tuple[str, ...]
) -> None:
    run = run_of(name, *overrides)
    flights, pieces = run.flights(), run.system.trace.pieces
    for ball in (1, len(run.system.bodies)):
        radius = run.system.bodies[ball - 1].radius

        def energy(s: Array, speed: Array, ball: int = ball, radius: float = radius) -> Array:
            s, found = np.clip(s, 0.0, run.system.trace.length), np.full(np.shape(s), np.nan)
            for piece in pieces:
                here = (s >= piece.start_s) & (s <= piece.start_s + piece.length)
                along = (s[here] - piece.start_s) / piece.length
                if piece.shape == "line":
                    place, scale = along * piece.length, 1.0
                else:
                    place = piece.angle_start + along * (piece.angle_end - piece.angle_start)
                    scale = piece.path_radius(radius)
                found[here] = on_trace(
                    run.system, ball, piece.index + 1, place, speed[here] / scale
                )
            return found

        mine = np.flatnonzero((flights["ball"] == ball) & ~flights["contact"])
        levels = np.empty(len(mine))
        for arc in range(1, len(pieces) + 1):
            here = flights["arc"][mine] == arc
            states = (flights[f"{what}_start"][mine][here] for what in ("angle", "rate"))
            levels[here] = on_trace(run.system, ball, arc, *states)
        axes = energy_portrait(run, ball).axes[0]
        assert _check(axes, flights["t_start"][mine], levels, energy) > 0


def _check(axes: Axes, start: Array, levels: Array, energy: Callable[..., Array]) -> int:
    """Check the free branches of a panel; return how many there are.

    Branches in the colours of time say when they begin; others have one of the levels.
    """
    number = 0
    for collection in branches_of(axes):
        segments, times = collection.get_segments(), collection.get_array()
        if times is None and len(start) > 60:
            continue  # lasting contact, which keeps no energy of one body
        for place in range(0, len(segments), 1 + len(segments) // MOST):
            segment = segments[place]
            points = points_of(np.asarray(segment))
            if times is not None:
                level = levels[np.flatnonzero(start == times[place])[0]]
                assert_on_level(points, level, energy, scale_of(axes))
                number += 1
            elif not _is_contact(collection):
                own = float(energy(*np.asarray(segment)[:1].T)[0])
                assert_on_level(points, own, energy, scale_of(axes))
                nearest = np.min(np.abs(levels - own))
                assert nearest <= 1e-9 * max(1.0, float(np.max(np.abs(levels))))
                number += 1
    return number


def _is_contact(collection: LineCollection) -> bool:
    from matplotlib.colors import to_rgb

    from vibro_cli.figures.portraits.layers import CONTACT

    colour: Any = collection.get_colors()[0]
    return to_rgb(colour) == to_rgb(CONTACT["color"])


@pytest.mark.parametrize(("name", "overrides"), SPRINGS)
def test_branches_of_springs_are_on_their_levels(name: str, overrides: tuple[str, ...]) -> None:
    run = run_of(f"springs/{name}", *overrides)
    states, times = run.trajectory.states, run.trajectory.times
    for ball in range(1, len(run.system.bodies) + 1):
        figure = springs_portrait(run, ball)
        upper, lower = figure.axes[:2]

        def energy(place: Array, speed: Array, ball: int = ball) -> Array:
            return on_spring(run.system, ball, place, speed)

        levels = energy(states["x"][:, ball - 1], states["v"][:, ball - 1])
        assert _check(upper, times, levels, energy) > 0
        place, stored = map(np.asarray, lower.lines[0].get_data())
        rest = on_spring(run.system, ball, place, np.zeros(len(place)))
        np.testing.assert_allclose(stored, rest, rtol=1e-12)
        for one, other in zip(branches_of(upper), branches_of(lower), strict=True):
            assert len(one.get_segments()) == len(other.get_segments())
            pairs = list(zip(one.get_segments(), other.get_segments(), strict=True))
            for curve, flat in pairs[:: 1 + len(pairs) // MOST]:
                _check_energies(np.asarray(curve), np.asarray(flat), energy, scale_of(lower))


def _check_energies(curve: Array, drawn: Array, energy: Any, width: Array) -> None:
    """Check that the energy over position is that of the branch above, over its whole range."""
    own = energy(*curve.T)
    assert np.min(drawn[:, 0]) == pytest.approx(np.min(curve[:, 0]), abs=width[0])
    assert np.max(drawn[:, 0]) == pytest.approx(np.max(curve[:, 0]), abs=width[0])
    assert np.all(drawn[:, 1] <= np.max(own) + width[1])
    assert np.all(drawn[:, 1] >= np.min(own) - width[1])


@pytest.mark.parametrize("overrides", [(), ("collision.k=0", "stop.time=20")])
def test_lasting_contact_of_springs_is_where_the_run_is(overrides: tuple[str, ...]) -> None:
    """The curves of bodies in contact pass through states of the run, and nowhere else."""
    run = run_of("springs/stressed_at_rest", *overrides)
    begins = [t for t, what in zip(run.events["t"], run.events["event"], strict=True)]
    sample = run.sample(np.linspace(max(begins), run.end_time, 3000))
    for ball in (1, 2, 3):
        upper = springs_portrait(run, ball).axes[0]
        (contact,) = (one for one in branches_of(upper) if _is_contact(one))
        width = scale_of(upper)
        mine = sample["ball"] == ball
        states = np.column_stack([sample["displacement"][mine], sample["speed"][mine]]) / width
        last = points_of(np.asarray(contact.get_segments()[-1])) / width
        apart = [np.min(np.hypot(*(states - point).T)) for point in last]
        assert max(apart) < 1.0
        back = [np.min(np.hypot(*(last - state).T)) for state in states[::50]]
        assert max(back) < 20.0  # nothing of it is left out


@pytest.mark.parametrize("name", ["two_disks", "stressed_at_rest"])
def test_level_curves_and_separatrices_of_springs(name: str) -> None:
    """Each has constant energy and is closed: it begins and ends at rest."""
    system = run_of(f"springs/{name}").system
    for ball in range(1, len(system.bodies) + 1):
        upper = springs_structure(system, ball).axes[0]
        curves = [one for one in upper.collections if isinstance(one, LineCollection)]
        assert curves
        for segment in (np.asarray(s) for one in curves for s in one.get_segments()):
            own = on_spring(system, ball, *segment.T)
            np.testing.assert_allclose(own, own[0], rtol=1e-9)
            assert np.array_equal(segment[0], segment[-1] * (1.0, -1.0))
            low, high = upper.get_xlim()
            assert low < np.min(segment[:, 0])
            assert np.max(segment[:, 0]) < high


@pytest.mark.parametrize(("name", "overrides"), TRACES)
def test_energies_of_a_trace_are_those_of_its_states(name: str, overrides: tuple[str, ...]) -> None:
    run = run_of(name, *overrides)
    axes = energies(run).axes[0]
    flights = run.flights()
    for ball in range(1, len(run.system.bodies) + 1):
        mine = np.flatnonzero(flights["ball"] == ball)
        level = np.empty(len(mine))
        for arc in range(1, len(run.system.trace.pieces) + 1):
            here = flights["arc"][mine] == arc
            states = (flights[f"{what}_start"][mine][here] for what in ("angle", "rate"))
            level[here] = on_trace(run.system, ball, arc, *states)
        _check_steps(axes, ball, run, level - _lowest(run.system, ball), flights, mine)


def _lowest(system: Any, ball: int) -> float:
    """Return the least energy (J) that a body at rest can have anywhere on the trace."""
    least = []
    for piece in system.trace.pieces:
        places = np.linspace(piece.angle_start, piece.angle_end, 20001)
        least.append(np.min(on_trace(system, ball, piece.index + 1, places, np.zeros(20001))))
    return float(min(least))


def _check_steps(axes: Axes, ball: int, run: Any, level: Array, flights: Any, mine: Any) -> None:
    line = np.column_stack(axes.lines[ball - 1].get_data())
    width = scale_of(axes)[1]
    middles = 0.5 * (line[1:] + line[:-1])[np.diff(line[:, 0]) > 1e-9]
    row = np.searchsorted(flights["t_start"][mine], middles[:, 0], side="right") - 1
    contact = flights["contact"][mine][row]
    assert np.max(np.abs(middles[:, 1] - level[row])[~contact], initial=0.0) < width
    some = np.flatnonzero(contact)[:: max(1, np.count_nonzero(contact) // 300)]
    if len(some):
        sample = run.sample(middles[some, 0])
        exact = sample["energy"][sample["ball"] == ball]
        assert np.max(np.abs(middles[some, 1] - exact)) < width


@pytest.mark.parametrize(("name", "overrides"), SPRINGS)
def test_energies_of_springs_are_those_of_their_states(
    name: str, overrides: tuple[str, ...]
) -> None:
    run = run_of(f"springs/{name}", *overrides)
    figure = springs_energies(run)
    assert figure is not None
    axes = figure.axes[0]
    times, states = run.trajectory.times, run.trajectory.states
    for ball in range(1, len(run.system.bodies) + 1):
        line = np.column_stack(axes.lines[ball - 1].get_data())
        middles = 0.5 * (line[1:] + line[:-1])[np.diff(line[:, 0]) > 1e-9]
        row = np.searchsorted(times, middles[:, 0], side="right") - 1
        held = states["held"][row]
        alone = held[:, ball - 1] == 0 if ball <= held.shape[1] else np.ones(len(row), bool)
        alone &= held[:, ball - 2] == 0 if ball > 1 else True
        level = on_spring(run.system, ball, states["x"][row, ball - 1], states["v"][row, ball - 1])
        assert np.max(np.abs(middles[:, 1] - level)[alone], initial=0.0) < scale_of(axes)[1]
        some = np.flatnonzero(~alone & (middles[:, 0] < 15.0))[::20]
        if len(some):
            sample = run.sample(middles[some, 0])
            exact = sample["energy"][sample["ball"] == ball]
            assert np.max(np.abs(middles[some, 1] - exact)) < scale_of(axes)[1]


@pytest.mark.parametrize(
    ("name", "overrides"), [one for one in TRACES if one[0] not in ("five_balls", "lone_particle")]
)
def test_films_show_states_of_the_run(name: str, overrides: tuple[str, ...]) -> None:
    """Points and trails of frames of the whole run, 24 of them: mostly further than periods."""
    run = run_of(name, *overrides)
    flights, end = run.flights(), float(np.max(run.flights()["t_end"]))
    for pace in (end, 0.4):
        shown = film_on_trace(run, frame_times(0.0, min(end, pace), pace, 24))
        film = Film(shown, 50.0)
        axes = film.plane
        for ball in range(1, len(run.system.bodies) + 1):
            seen = 0
            for frame in range(0, len(shown.time), 4):
                film.picture(frame)
                moving = film._moving[ball - 1]
                for artist in (moving.line, moving.point):
                    drawn = np.column_stack(artist.get_data())
                    seen += _check_trail(run, ball, drawn, shown.time[frame], axes, flights)
            assert seen > 0


def _check_trail(run: Any, ball: int, drawn: Array, until: float, axes: Axes, flights: Any) -> int:
    """Check the straight parts of a trail that lie within one flight; return how many points."""
    system = run.system
    mine = np.flatnonzero((flights["ball"] == ball) & (flights["t_start"] <= until))[-60:]
    if np.any(flights["contact"][mine]):
        return 1  # no energy of a body is kept
    levels: dict[int, list[float]] = {}
    for row in mine.tolist():
        arc = int(flights["arc"][row])
        state = (np.array([flights[f"{what}_start"][row]]) for what in ("angle", "rate"))
        levels.setdefault(arc, []).append(float(on_trace(system, ball, arc, *state)[0]))
    parts = (
        np.array([np.stack(pair) for pair in pairwise(drawn)]) if len(drawn) > 1 else drawn[None]
    )
    parts = parts[np.all(np.isfinite(parts), axis=(1, 2))]
    moved = np.ptp(parts[:, :, 0], axis=1) > 0.0  # not the jumps
    points = np.concatenate([drawn[np.isfinite(drawn[:, 0])], parts[moved].mean(axis=1)])
    checked = 0
    for piece in system.trace.pieces:
        own = levels.get(piece.index + 1)
        here = (points[:, 0] > piece.start_s) & (points[:, 0] < piece.start_s + piece.length)
        if own is None or not np.any(here):
            continue
        line = piece.shape == "line"
        side = {"valley": 1.0, "hump": -1.0, "line": 0.0}[piece.shape]
        scale = 1.0 if line else piece.radius - side * system.bodies[ball - 1].radius

        def energy(s: Array, speed: Array, piece: Any = piece, scale: float = scale) -> Array:
            along = s - piece.start_s
            place = along if piece.shape == "line" else piece.angle_start + along / piece.radius
            return on_trace(system, ball, piece.index + 1, place, speed / scale)

        mid = energy(*points[here].T)
        nearest = np.array([own[int(np.argmin(np.abs(np.array(own) - one)))] for one in mid])
        assert_on_level(points[here], nearest, energy, scale_of(axes))
        checked += int(np.sum(here))
    return checked


@pytest.mark.parametrize(("name", "overrides"), TABLES)
def test_energies_and_paths_on_a_table_are_those_of_the_motion(
    name: str, overrides: tuple[str, ...]
) -> None:
    run = run_of(f"table/{name}", *overrides)
    bodies, end = run.system.bodies, run.end_time
    figure = table_energies(run)
    for ball, body in enumerate(bodies):
        if figure is not None:
            line = np.column_stack(figure.axes[0].lines[ball].get_data())
            steps = np.diff(line[:, 0]) > 1e-9 * end
            middles = (0.5 * (line[1:] + line[:-1]))[steps][:: 1 + len(line) // MOST]
            moved = run.sample(middles[:, 0])
            square = (moved["velocity_x"] ** 2 + moved["velocity_y"] ** 2)[ball :: len(bodies)]
            own = 0.5 * body.kappa * body.mass * square
            assert np.max(np.abs(middles[:, 1] - own)) < scale_of(figure.axes[0])[1]
    axes = table_plan(run).axes[0]
    paths = [one for one in axes.collections if isinstance(one, LineCollection)]
    assert len(paths) == len(bodies)
    for ball, path in enumerate(paths):
        drawn = np.concatenate([np.asarray(part)[:-1] for part in path.get_segments()])
        times = _events_of(run, ball + 1)[: len(drawn)]
        moved = run.sample(times)
        exact = np.column_stack([moved[axis][ball :: len(bodies)] for axis in "xy"])
        assert np.max(np.abs(drawn - exact) / scale_of(axes)) < 1.0
        assert len(times) == len(drawn)


def _events_of(run: Any, ball: int) -> Array:
    """Return the start, and the times (s) at which a ball meets another or the wall."""
    tables = ((run.collisions, "ball_a"), (run.collisions, "ball_b"), (run.bounces, "ball"))
    met = [np.asarray(table["t"])[np.asarray(table[name]) == ball] for table, name in tables]
    return np.append(0.0, np.sort(np.concatenate(met)))
