"""Which impacts a section shows, and its figures of runs and grids."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vibro_cli import NothingToShow, example, open_run, simulate, sweep
from vibro_cli.commands.app import run_command_line
from vibro_cli.figures import maps, over_axis
from vibro_cli.figures.maps import parameter_map
from vibro_cli.figures.over_axis import LAST, Section
from vibro_cli.storage.stored import StoredGrid


@pytest.mark.parametrize("transient", [None, 0, 3, 25])
@pytest.mark.parametrize("pair", [None, (1, 2), (2, 3)])
def test_the_impacts_chosen_are_those_counted_one_by_one(
    pair: tuple[int, int] | None, transient: int | None
) -> None:
    rng = np.random.default_rng(5)
    lengths = [0, 1, 19, 20, 21, 22, 60, 45]
    run = np.repeat(np.arange(len(lengths)), lengths)
    ball = rng.integers(1, 3, len(run))
    chosen = Section(pair, transient).chosen({"ball_a": ball, "ball_b": ball + 1}, run)
    for number, length in enumerate(lengths):
        mine = [n for n in range(len(run)) if run[n] == number]
        mine = [n for n in mine if pair is None or ball[n] == pair[0]]
        last = mine[-LAST:] if len(mine) > LAST else []
        mine = last if transient is None else mine[transient:]
        assert np.flatnonzero(chosen & (run == number)).tolist() == mine, (length, number)


def test_a_grid_shows_the_impacts_after_the_transient() -> None:
    axes = {"collision.k": np.linspace(0.8, 0.9, 3)}
    grid = sweep(example("one_circle"), axes, collisions=True)
    figure = grid.section(["angle_a"], transient=40).figure
    (axes_drawn,) = figure.axes
    points = np.vstack([np.asarray(c.get_offsets()) for c in axes_drawn.collections])
    table = grid.collisions
    wanted = np.asarray(table["angle_a"])[np.asarray(table["n"]) > 40]
    assert sorted(points[:, 1]) == pytest.approx(sorted(wanted), abs=0.0)
    assert len(wanted) > 20
    with pytest.raises(ValueError, match="found the column 'angle'"):
        grid.section(["angle"])
    with pytest.raises(
        ValueError, match=r"after the first 100000; the most that a run has are \d+"
    ):
        grid.section(["angle_a"], transient=100000)


def test_it_is_said_how_many_runs_of_a_grid_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    axes = {"collision.k": np.linspace(0.3, 0.9, 9)}
    grid = sweep(example("one_circle"), axes, tmp_path / "grid", collisions=True)
    counts = np.asarray(grid.summary["collisions"])
    assert grid.impacts_of_runs().tolist() == counts.tolist()
    assert grid.impacts_of_runs((1, 2)).tolist() == counts.tolist()
    assert grid.impacts_of_runs((2, 3)).tolist() == [0] * 9
    many = int((counts > 20).sum())
    assert 1 < many < 9
    arguments = ["section", str(tmp_path / "grid")]
    assert run_command_line(arguments) == 0
    told = f"{many} of 9 runs have more than 20 impacts; --transient 0 shows every impact\n"
    assert capsys.readouterr().err.startswith(told)
    assert run_command_line([*arguments, "--transient", str(counts.max() - 1)]) == 0
    assert f"1 of 9 runs has more than {counts.max() - 1} impacts" in capsys.readouterr().err
    assert run_command_line([*arguments, "--transient", "0"]) == 0
    assert capsys.readouterr().err.startswith("section in ")
    assert run_command_line([*arguments, "--transient", str(counts.max())]) == 2
    most = f"after the first {counts.max()}; the most that a run has are {counts.max()}\n"
    assert capsys.readouterr().err.endswith(most)
    few = {"stop.collisions": [1, 2, 3]}
    sweep(example("one_circle"), few, tmp_path / "few", collisions=True)
    assert run_command_line(["section", str(tmp_path / "few"), "--transient", "1"]) == 0
    assert "2 of 3 runs have more than 1 impact; --transient 0" in capsys.readouterr().err


def test_the_runs_of_a_section_are_found_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Texts and figures share them: for a million points that search takes a third of a second."""
    asked: list[str] = []

    def counted(grid: StoredGrid, *more: Any, **named: Any) -> Any:
        asked.append(grid.name)
        return parameter_map(grid, *more, **named)

    for module in (maps, over_axis):
        monkeypatch.setattr(module, "parameter_map", counted)
    axes = {"collision.k": [0.5, 0.6], "balls[1].mass": [1.0, 2.0, 3.0]}
    sweep(example("one_circle"), axes, tmp_path / "grid", collisions=True)
    assert run_command_line(["section", str(tmp_path / "grid"), "--transient", "0"]) == 0
    assert len(asked) == 1


def test_a_run_shows_one_column_over_another(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = simulate(example("five_balls"))
    figure = run.section(["s_a", "speed_a_pre"], pair=(2, 3), transient=5).figure
    points = np.vstack([np.asarray(c.get_offsets()) for c in figure.axes[0].collections])
    mine = np.asarray(run.collisions["ball_a"]) == 2
    wanted = np.asarray(run.collisions["s_a"])[mine][5:]
    assert points[:, 0].tolist() == wanted.tolist()
    pair = int(mine.sum())
    with pytest.raises(ValueError, match=f"after the first {pair}; the most .* are {pair}$"):
        run.section(["s_a", "speed_a_pre"], pair=(2, 3), transient=pair)
    folder = run.save(tmp_path / "run", figures=False)
    arguments = ["section", str(folder), "--column", "s_a", "--column", "speed_a_pre"]
    assert run_command_line([*arguments, "--pair", "2-3", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"file": str(tmp_path / "run-section.png")}
    assert (tmp_path / "run-section.png").read_bytes()[:4] == b"\x89PNG"
    assert run_command_line([*arguments[:4]]) == 2
    assert "expected two" in capsys.readouterr().err
    assert run_command_line([*arguments[:3], "s_a,speed_a_pre"]) == 0
    assert run_command_line([*arguments[:2]]) == 0
    assert run_command_line([*arguments, "--pair", "23"]) == 2
    assert run_command_line([*arguments, "-o", "x.jpg"]) == 2


@pytest.mark.parametrize("pair", [(1, 3), (3, 1), (2, 1)])
def test_the_bodies_of_a_pair_may_be_named_in_either_order(pair: tuple[int, int]) -> None:
    """The seam of a closed trace is between bodies 3 and 1, with 3 on the left."""
    run = simulate(example("closed_three_balls"))
    figure = run.section(["s_a", "speed_a_pre"], pair=pair).figure
    points = np.vstack([np.asarray(c.get_offsets()) for c in figure.axes[0].collections])
    bodies = zip(run.collisions["ball_a"].tolist(), run.collisions["ball_b"].tolist(), strict=True)
    mine = [set(two) == set(pair) for two in bodies]
    assert points[:, 0].tolist() == np.asarray(run.collisions["s_a"])[mine].tolist()
    assert 0 < len(points) < len(mine)


def test_a_grid_says_why_it_has_nothing_to_show() -> None:
    axes = {"collision.k": np.linspace(0.8, 0.9, 3)}
    kept = sweep(example("one_circle"), axes, collisions=["n", "t", "angle_a"])
    bare = sweep(example("one_circle"), axes)
    told = r"kept no impacts: set collisions = true in \[keep\], or collisions=True of sweep"
    for columns in ([], ["angle_a"]):
        with pytest.raises(NothingToShow, match=told):
            bare.section(columns)
    with pytest.raises(NothingToShow, match=r"ball_a and ball_b: .* collisions=\[…\] of sweep"):
        kept.section(["angle_a"], (1, 2))
    short = sweep(example("three_arcs"), axes, collisions=True)
    with pytest.raises(NothingToShow, match="no run has more than 20 impacts of bodies 2 and 3"):
        short.section(["s_a"], (2, 3))


def test_a_ball_alone_on_a_table_shows_its_impacts_on_the_wall() -> None:
    run = simulate(example("elliptic_wall"))
    walls = run.bounces
    figure = run.section(["normal_angle", "tangential_speed"]).figure
    points = np.vstack([np.asarray(c.get_offsets()) for c in figure.axes[0].collections])
    assert points[:, 0].tolist() == np.asarray(walls["normal_angle"]).tolist()
    assert figure.axes[0].get_ylabel() == r"$v_{\mathrm{t}}$ [m/s]"


def test_an_edge_that_a_wall_does_not_have_is_not_shown(tmp_path: Path) -> None:
    """A run that was not opened from a folder used to show it as edge 0."""
    run = simulate(example("elliptic_wall"))
    run.save(tmp_path / "run", figures=False)
    assert np.ma.getmaskarray(run.bounces["edge"]).all()
    for one in (run, open_run(tmp_path / "run")):
        with pytest.raises(ValueError, match="there is no impact"):
            one.section(["edge", "t"])


def test_impacts_without_a_value_along_are_left_out(tmp_path: Path) -> None:
    """There is no interval before the first impact; the axis used to end at NaN."""
    run = simulate(example("one_circle"))
    run.save(tmp_path / "run", figures=False)
    times = np.asarray(run.collisions["t"])
    for one in (run, open_run(tmp_path / "run")):
        (axes,) = one.section(["dt", "t"]).figure.axes
        points = np.vstack([np.asarray(c.get_offsets()) for c in axes.collections])
        np.testing.assert_array_equal(points[:, 1], times[1:])
        rounding = 2.0 * np.spacing(times[-1])  # of two times and of their difference
        np.testing.assert_allclose(points[:, 0], np.diff(times), rtol=0.0, atol=rounding)


def test_runs_and_grids_have_the_same_words_for_the_angle_on_one_arc() -> None:
    run = simulate(example("one_circle"))
    axes = {"collision.k": np.linspace(0.8, 0.9, 3)}
    grid = sweep(example("one_circle"), axes, collisions=True)
    named = r"$\varphi$ of the left body [rad]"
    assert run.section().figure.axes[0].get_xlabel() == named
    assert grid.section(transient=0).figure.axes[0].get_ylabel() == named


def test_a_run_on_a_line_is_shown_by_its_places(tmp_path: Path) -> None:
    """A line has no angles; the program used to say that there are no impacts."""
    run = simulate(example("falling_balls").replace({"stop.collisions": 30}))
    run.save(tmp_path / "run", figures=False)
    for one in (run, open_run(tmp_path / "run")):
        (axes,) = one.section().figure.axes
        points = np.vstack([np.asarray(c.get_offsets()) for c in axes.collections])
        assert axes.get_xlabel() == "$s_{a}$ [m]"
        np.testing.assert_array_equal(np.sort(points[:, 0]), np.sort(run.collisions["s_a"]))
    with pytest.raises(ValueError, match="found t, expected two columns of impacts"):
        run.section(["t"])


def test_a_section_has_as_much_room_on_the_left_as_on_the_right() -> None:
    """A lonely impact at one end used to extend the axis by half the gap beside it."""
    run = simulate(example("three_arcs"))
    (axes,) = run.section(["s_a", "speed_a_pre"], transient=0).figure.axes
    along, up = np.vstack([np.asarray(c.get_offsets()) for c in axes.collections]).T
    for places, limits in ((along, axes.get_xlim()), (up, axes.get_ylim())):
        room = np.abs(np.array([np.min(places), np.max(places)]) - limits)
        assert room == pytest.approx([0.06 * np.ptp(places)] * 2)


def test_it_is_said_at_which_values_other_axes_are_held(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The picture shows one slice of the grid, and used not to say which."""
    axes = {"collision.k": [0.8, 0.85, 0.9], "balls[1].angle": [-1.0, -0.9]}
    sweep(example("one_circle"), axes, tmp_path / "grid", collisions=True)
    assert run_command_line(["section", str(tmp_path / "grid"), "--transient", "0"]) == 0
    told = capsys.readouterr().err.splitlines()
    assert told[0] == "held: balls[1].angle = -1 rad"
    assert told[-1].startswith("section in ")
