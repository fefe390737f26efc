"""A point of a grid is the run of its scenario, to the last bit, however it was solved."""

from __future__ import annotations

import os
import signal
import threading
import tracemalloc
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import vibro_cli as interface
from vibro_cli.api import simulate
from vibro_cli.assemble import build_any, build_system
from vibro_cli.grids import workers
from vibro_cli.grids.chunks import Chunks, Expected
from vibro_cli.grids.document import Grid, document_at, load_grid
from vibro_cli.grids.solving import solver_of
from vibro_cli.grids.workers import solve_in_threads
from vibro_cli.kernels.ensemble.records import Stack, StartData
from vibro_cli.kernels.world import World
from vibro_cli.scenario import ScenarioError
from vibro_cli.scenario.loading import load_any, scenario_of
from vibro_cli.scenario.models import Scenario
from vibro_cli.scenario.problems import KeyPath
from vibro_cli.systems.driver import ENGINES, records_of
from vibro_cli.systems.request import Limits
from vibro_cli.systems.trace import grid_solver
from vibro_cli.systems.trace.grid_solver import TraceSolver, impact_columns
from vibro_cli.systems.trace.system_template import Reader
from vibro_cli.systems.trace.world import make_world

SCENARIOS = Path(__file__).parents[2] / "scenarios"
POINTS = 60

GRIDS: dict[str, tuple[str, dict[str, list[float]]]] = {
    "two balls, starts and k": (
        "three_arcs.toml",
        {"balls[1].angle": [-1.5, 0.9], "balls[2].angle": [-0.9, 2.2], "collision.k": [0.3, 1.05]},
    ),
    "accumulation": (
        "one_circle.toml",
        {"balls[1].angle": [-1.2, -0.1], "collision.k": [0.0, 0.6], "balls[2].rate": [-1.0, 1.0]},
    ),
    "masses and speeds": (
        "unequal_hedrih.toml",
        {
            "balls[1].mass": [0.1, 9.0],
            "balls[2].density": [-100.0, 9000.0],
            "balls[1].omega": [-9, 9],
        },
    ),
    "radii and gravity": (
        "three_arcs.toml",
        {"balls[1].radius": [0.02, 0.6], "gravity": [1.0, 20.0], "stop.time": [-0.5, 9.0]},
    ),
    "radius of a body whose rolling is given": (
        "horizontal_line_1_2.toml",
        {"balls[1].radius": [-0.05, 0.4], "balls[2].position": [1.2, 4.0]},
    ),
    "several balls": (
        "five_balls.toml",
        {
            "balls[3].angle": [-0.5, 0.5],
            "balls[1].speed": [-2.0, 2.0],
            "collision.k[2]": [0.5, 1.0],
        },
    ),
    "closed": (
        "closed_three_balls.toml",
        {"balls[1].angle": [-0.5, 0.5], "collision.k": [0.6, 1.0]},
    ),
    "turning": (
        "one_circle.toml",
        {"balls[1].angle": [-1.2, -0.3], "collision.k": [0.6, 1.0], "balls[2].rate": [-1.0, 1.0]},
    ),
    "radius, gravity and thickness": (
        "three_arcs.toml",
        {
            "balls[1].thickness": [0.005, 0.05],
            "balls[1].radius": [0.02, 0.3],
            "balls[2].radius": [0.02, 0.3],
            "gravity": [0.5, 20.0],
        },
    ),
    "inertia and radius": (
        "ball_on_arcs.toml",
        {"balls[2].inertia_ratio": [0.0, 1.0], "balls[1].radius": [-0.02, 0.2]},
    ),
    "radii of many": (
        "five_balls.toml",
        {"balls[2].radius": [0.005, 0.3], "balls[4].radius": [0.005, 0.3]},
    ),
    "radii on a closed trace": (
        "closed_three_balls.toml",
        {"balls[2].radius": [0.005, 0.3], "balls[1].radius": [0.005, 0.3]},
    ),
    "gravity of many": ("five_balls.toml", {"gravity": [1.0, 20.0], "balls[2].angle": [-0.9, 0.0]}),
    "walls": (
        "three_arcs.toml",
        {"ends.left.wall": [-0.1, 1.0], "balls[1].radius": [0.02, 0.3], "gravity": [1.0, 20.0]},
    ),
    "arcs": (
        "three_arcs.toml",
        {
            "trace.arcs[1].radius": [0.6, 1.5],
            "trace.arcs[2].end_slope": [-1.2, 0.3],
            "balls[2].angle": [-0.4, 0.4],
        },
    ),
    "slopes": (
        "three_arcs.toml",
        {"trace.start_slope": [-2.4, -1.0], "trace.arcs[1].end_slope": [0.2, 1.2]},
    ),
    "length of a line": (
        "line_between_valleys.toml",
        {"trace.arcs[2].length": [0.5, 2.5], "balls[2].radius": [0.02, 0.2]},
    ),
    "lines": (
        "line_between_valleys.toml",
        {"balls[1].angle": [-1.2, 0.5], "collision.k": [0.5, 1.0], "balls[1].mass": [1.0, 3.0]},
    ),
    "bodies that touch": (
        "three_arcs.toml",
        {"balls[1].rate": [-1.0, 1.0], "collision.k": [0.2, 1.0], "gravity": [1.0, 20.0]},
    ),
    "too large to pass one another": (
        "three_arcs.toml",
        {"balls[1].radius": [0.3, 0.9], "balls[2].radius": [0.3, 0.6]},
    ),
    "the longest time": (
        "three_arcs.toml",
        {"stop.time": [0.9e300, 1.1e300], "balls[1].angle": [-1.5, -1.3]},
    ),
    "bodies that never meet again": (
        "three_arcs.toml",
        {"balls[1].speed": [0.9, 1.4], "balls[2].speed": [-1.3, 0.3], "gravity": [9.0, 10.0]},
    ),
}

MORE = {
    "turning": ["trace.turning={through_arc = 1, rate = 1.5}", "stop.time=6"],
    "radius, gravity and thickness": ["balls[1].body=disk"],
    "walls": ["ends.left={wall = 0.9}", "ends.right={wall = 0.8}", "balls[1].angle=-0.3"],
    "inertia and radius": ["collision.law=translational"],
    "bodies that touch": ["balls[2].touching=previous", "balls[2].arc=1"],
    "too large to pass one another": ["balls[1].angle=-1.3"],
    "the longest time": ["stop.collisions=1"],
    "bodies that never meet again": [
        "stop={collisions = 8}",
        "collision.k=0.7",
        *("balls[1].arc=2", "balls[1].angle=-0.5", "balls[2].arc=2", "balls[2].angle=0.5"),
    ],
}

# What must occur among the points of each, so that the test is meaningful.
SEEN = {
    "two balls, starts and k": {"invalid", "contact", "end_of_trace", "time"},
    "accumulation": {"contact"},
    "masses and speeds": {"invalid", "inadmissible"},
    "radii and gravity": {"invalid", "time"},
    "radius of a body whose rolling is given": {"invalid", "end_of_trace"},
    "several balls": {"invalid", "collisions"},
    "closed": {"collisions"},
    "turning": {"contact", "free"},
    "radius, gravity and thickness": {"free", "time"},
    "inertia and radius": {"invalid", "free"},
    "radii of many": {"invalid", "free"},
    "radii on a closed trace": {"invalid", "free"},
    "gravity of many": {"collisions"},
    "walls": {"invalid", "time"},
    "arcs": {"invalid", "free"},
    "slopes": {"invalid", "free"},
    "length of a line": {"invalid", "free"},
    "lines": {"free", "inadmissible"},
    "bodies that touch": {"contact"},
    "too large to pass one another": {"free"},
    "the longest time": {"invalid", "free"},
    "bodies that never meet again": {"free", "no_more_collisions", "collisions"},
}


# Those whose keys, laws and kinds of trace others have, too.
LONGER = {"radii of many", "gravity of many"}


def grid_of(
    tmp_path: Path,
    base: str,
    axes: dict[str, Any],
    overrides: Sequence[str] = (),
    keep: str = "true",
) -> Grid:
    """A design of random points over the given intervals."""
    lines = [
        f'base = "{SCENARIOS / base}"',
        'mode = "latin-hypercube"',
        f"n = {POINTS}",
        "seed = 7",
    ]
    for path, interval in axes.items():
        lines += ["[[axes]]", f'path = "{path}"', f"uniform = {interval}"]
    lines += ["[keep]", f"collisions = {keep}"]
    file = tmp_path / "grid.toml"
    file.write_text("\n".join(lines))
    return load_grid(file, ["stop.collisions=40", *overrides])


def scenario_at(grid: Grid, values: dict[KeyPath, Any], row: int) -> Scenario:
    """Return the scenario of one point, by the ordinary reader."""
    return scenario_of(document_at(grid.base, {path: values[path][row] for path in values}))


def plain(column: Any) -> list[Any]:
    """Return a column as Python values, None for null and NaN."""
    rows = zip(np.ma.getdata(column).tolist(), np.ma.getmaskarray(column).tolist(), strict=True)
    return [None if null or value != value else value for value, null in rows]


def rows_of(columns: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the rows of a table in columns."""
    rows = zip(*(plain(column) for column in columns.values()), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in rows]


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.long] if name in LONGER else []) for name in GRIDS],
)
def test_points_are_runs(name: str, tmp_path: Path) -> None:
    grid = grid_of(tmp_path, *GRIDS[name], MORE.get(name, ()))
    indices = np.arange(POINTS)
    solved = TraceSolver(grid, "compiled").solve(indices)
    values = grid.design.columns(indices)
    collisions = solved.kept["collisions"]
    scenarios = collisions["scenario"].to_numpy()
    # Without their impacts, points may be solved in another way.
    without = TraceSolver(grid_of(tmp_path, *GRIDS[name], MORE.get(name, ()), "false"), "compiled")
    points = rows_of(solved.summary)
    assert rows_of(without.solve(indices).summary) == points
    seen = {found["end_cause"] or found["status"] for found in points}
    for row, found in zip(indices.tolist(), points, strict=True):
        impacts = np.flatnonzero(scenarios == row + 1)
        try:
            scenario = scenario_at(grid, values, row)
            build_system(scenario)
        except ScenarioError as error:
            texts = [f"{p.path}: found {p.found}, expected {p.expected}" for p in error.problems]
            assert (found["status"], found["reason"]) == ("invalid", "; ".join(texts))
            assert not len(impacts)
            continue
        run = simulate(scenario, ENGINES[row % 2])  # the interpreter takes most of the time
        assert found == run.summary_record()
        seen.add("contact" if found["contacts"] else "free")
        for key, column in run.collisions.items():
            of_grid = collisions[key].take(impacts).to_pylist()
            assert of_grid == plain(column), key
    assert seen >= SEEN[name], seen


QUICK: dict[str, tuple[str, str, list[float], Sequence[str]]] = {
    "radius": ("three_arcs.toml", "balls[1].radius", [0.02, 0.3], ()),
    "radius of many": ("five_balls.toml", "balls[3].radius", [0.05, 0.08], ()),
    "gravity": ("five_balls.toml", "gravity", [1.0, 20.0], ()),
    "thickness": ("three_arcs.toml", "balls[1].thickness", [0.005, 0.05], ["balls[1].body=disk"]),
    "inertia": ("ball_on_arcs.toml", "balls[1].inertia_ratio", [0.0, 1.0], ()),
    "radius of an arc": ("three_arcs.toml", "trace.arcs[2].radius", [0.4, 0.6], ()),
    "slope": ("three_arcs.toml", "trace.arcs[1].end_slope", [0.8, 1.0], ()),
    "start slope": ("three_arcs.toml", "trace.start_slope", [-2.3, -1.9], ()),
    "length": ("line_between_valleys.toml", "trace.arcs[2].length", [1.5, 2.5], ()),
    "wall": ("three_arcs.toml", "ends.left.wall", [0.1, 1.0], ["ends.left={wall = 0.9}"]),
    "density": ("closed_three_balls.toml", "balls[1].density", [1e3, 9e3], ()),
    "k": ("closed_three_balls.toml", "collision.k", [0.6, 1.0], ()),
    "rate beside a body that touches": (
        "one_circle.toml", "balls[1].rate", [-1.0, 0.0], ["balls[2].touching=previous"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", QUICK)
def test_numbers_are_read_once_for_all_points(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    base, path, interval, overrides = QUICK[name]
    grid = grid_of(tmp_path, base, {path: interval}, overrides)
    reads: list[Any] = []
    read = Reader.read

    def counted(self: Reader, values: Any) -> Any:
        reads.append(values)
        return read(self, values)

    monkeypatch.setattr(Reader, "read", counted)
    solved = TraceSolver(grid, "compiled").solve(np.arange(POINTS))
    assert set(solved.summary["status"]) == {"ok"}
    assert len(reads) == 1


def test_words_of_bodies_may_be_an_axis(tmp_path: Path) -> None:
    file = tmp_path / "words.toml"
    base = f'base = "{SCENARIOS / "three_arcs.toml"}"'
    words = '[[axes]]\npath = "balls[1].body"\nvalues = ["ball", "particle"]'
    numbers = '[[axes]]\npath = "collision.k"\nvalues = [0.8, 1.0]'
    file.write_text("\n".join([base, words, numbers]))
    grid = load_grid(file)
    together, alone = (
        TraceSolver(grid, engine).solve(np.arange(4)).summary for engine in ("compiled", "python")
    )
    for name, column in alone.items():
        np.testing.assert_array_equal(together[name], column, err_msg=name)


@pytest.mark.parametrize("engine", ["compiled", "python"])
def test_no_log_is_held_once_a_stretch_is_solved(
    engine: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Logs of long runs fill the memory, and the next stretch may come late or not at all."""
    logs: list[weakref.ref[Any]] = []

    def noted(table: Any, logged: Any, points: Any) -> Any:
        logs.extend(weakref.ref(one.log) for one in logged)
        return impact_columns(table, logged, points)

    monkeypatch.setattr(grid_solver, "impact_columns", noted)
    solver = TraceSolver(grid_of(tmp_path, *GRIDS["two balls, starts and k"]), engine)
    solver.solve(np.arange(4))
    assert logs
    assert all(one() is None for one in logs)


LONG_POINTS = {
    "one_circle.toml": ("collisions", "balls[1].angle", [-0.72, -0.7], "collision.k=1"),
    "table/elliptic_wall.toml": ("bounces", "balls[1].x", [0.1, 0.2], "wall.k=1"),
}


@pytest.mark.parametrize("name", LONG_POINTS)
def test_memory_of_a_point_does_not_grow_with_its_impacts(name: str, tmp_path: Path) -> None:
    """This includes runs that are too long for the logs of many points and are solved alone."""
    counted, path, interval, lossless = LONG_POINTS[name]
    peaks = []
    for impacts in (100_000, 400_000):
        more = [f"stop={{{counted} = {impacts}}}", lossless]
        solver = solver_of(grid_of(tmp_path, name, {path: interval}, more, "false"))
        tracemalloc.start()
        solved = solver.solve(np.arange(1))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert solved.impacts == impacts
    assert peaks[1] < 1.2 * peaks[0]


class Struck(threading.Event):
    """An event that interrupts the main thread when a thread first looks at it."""

    def __init__(self) -> None:
        super().__init__()
        self._first = iter([True])

    def is_set(self) -> bool:
        if next(self._first, False):
            os.kill(os.getpid(), signal.SIGALRM)
        return super().is_set()


@pytest.mark.usefixtures("no_hang")
@pytest.mark.parametrize("name", LONG_POINTS)
def test_a_grid_that_is_interrupted_does_not_wait_for_long_points(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The signal comes as soon as a point that is being solved looks whether to stop."""
    counted, path, interval, lossless = LONG_POINTS[name]
    more = [f"stop={{{counted} = 1000000000}}", lossless]
    grid = grid_of(tmp_path, name, {path: interval}, more, "false")
    folder = tmp_path / "made"
    (folder / "summary").mkdir(parents=True)
    chunks = Chunks.of(grid, Expected(1e9, 1e9), None)
    stand_in = SimpleNamespace(Event=Struck, local=threading.local)
    monkeypatch.setattr(workers, "threading", stand_in)
    receipts = solve_in_threads(
        grid, chunks, range(chunks.count), folder, 2, "compiled", lambda points, impacts: None
    )

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):
            list(receipts)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert not list(folder.rglob("*.parquet"))


def test_points_of_other_gravity_are_runs_whichever_point_is_first() -> None:
    """What lasts no time, and what is rounding of a place, are those of each point's own system."""
    scenario = interface.load_scenario(Path(__file__).with_name("at_a_wall.json"))
    for gravities in ([9.81, 1.6], [1.6, 9.81]):
        grid = interface.sweep(scenario, {"gravity": gravities}, collisions=True, workers=1)
        for number, gravity in enumerate(gravities, 1):
            run = interface.simulate(scenario.replace({"gravity": gravity}))
            rows = grid.collisions["scenario"] == number
            for name in ("t", "energy_b_pre", "energy_loss", "speed_a_post"):
                assert np.array_equal(grid.collisions[name][rows], run.collisions[name]), name


def test_every_number_of_the_records_comes_with_the_system_or_the_start_of_a_point() -> None:
    """A point takes nothing from another: every number of its records is set."""
    walls = {"ends.left.wall": 0.8, "ends.right.wall": 0.7}
    start = {"balls[1].position": 0.4, "balls[2].position": 1.7, "collision.k": 0.4}
    shape = {"trace.start_slope": -0.3, "trace.arcs[1].length": 2.5, "gravity": 1.6}
    body = {"balls[1].radius": 0.2, "balls[2].radius": 0.15, "balls[2].density": 2000.0}
    one = load_any(SCENARIOS / "horizontal_line_1_2.toml").replace(
        {"ends": {"left": {"wall": 0.9}, "right": {"wall": 0.9}}}
    )
    arcs = load_any(SCENARIOS / "three_arcs.toml").replace({"stop.time": 9.0})
    other_arcs = {
        "trace.start_slope": -1.9, "trace.arcs[1].radius": 1.3, "trace.arcs[2].end_slope": -1.1,
        "gravity": 1.6, "balls[1].radius": 0.2, "balls[1].thickness": 0.3, "balls[2].angle": 0.2,
        "balls[1].mass": 3.0, "collision.k": 0.4, "stop.time": 5.0,
    }  # fmt: skip
    of_points = {
        "settings": {"stop_t", "stop_collisions"},
        "pairs": {"restitution"},
        "flights": {*fields_of(StartData), "own_frequency"},
    }
    stacked = {name: set(fields_of(cls)) for name, cls in records_of(Stack).items()}
    for first, changes in ((one, walls | start | shape | body), (arcs, other_arcs)):
        worlds = [
            make_world(build_any(scenario), Limits(scenario.stop.time, scenario.stop.collisions))
            for scenario in (first, first.replace(changes))
        ]
        for name, record in records_of(World).items():
            differ = {
                field
                for pair in zip(*(getattr(world, name) for world in worlds), strict=True)
                for field in fields_of(record)
                if getattr(pair[0], field) != getattr(pair[1], field)
            }
            assert differ <= stacked.get(name, set()) | of_points.get(name, set()), name
            assert bool(differ) == (name in stacked), name


def fields_of(struct: Any) -> list[str]:
    """Return the names of the fields of a kernel struct."""
    return list(struct.fields)
