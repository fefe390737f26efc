"""The numbers of the papers, recomputed; and the page that lists the command for each."""

from __future__ import annotations

import math
import re
import runpy
import shlex
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from mpmath import mp

from tests.gallery import GALLERY, run_of
from tests.pages import DOCS, text_of
from vibro_cli import Scenario, example, simulate
from vibro_cli.analysis.levels import Landscape
from vibro_cli.analysis.paper_formulas import (
    CORRECT,
    CentralImpact,
    Swing,
    partial_sums,
    printed_time,
    series_time,
)
from vibro_cli.analysis.singular import portrait_of
from vibro_cli.assemble import build_any
from vibro_cli.commands.app import run_command_line
from vibro_cli.commands.help import LETTERS, rows_of
from vibro_cli.mechanics.reachability import contact_angle
from vibro_cli.report.papers import series_rows, time_between, turning_points
from vibro_cli.scenario import load_any
from vibro_cli.storage.stored import open_run
from vibro_cli.systems import NAMES, system_named
from vibro_cli.systems.springs.phase_plane import spring_periods, springs_record
from vibro_cli.systems.trace.describe import quantities_of

# Paper B

RATIOS = {
    "horizontal_line_1_2": (1 / 2, 1 / 33, 32 / 33),
    "horizontal_line_1_3": (1 / 3, 1 / 244, 243 / 244),
    "horizontal_line_2_3": (2 / 3, 32 / 275, 243 / 275),
}


@pytest.mark.parametrize("name", RATIOS)
def test_worked_ratios(name: str) -> None:
    """B, examples a*, b*, c*: the large coefficient belongs to the smaller ball, by B (15)."""
    run = run_of(name, "collision.k=1", "collision.inadmissible=normal-impulse")
    ratio, small, large = RATIOS[name]
    table, (first, second) = run.collisions, run.system.bodies
    assert second.radius / first.radius == pytest.approx(ratio, rel=1e-15)
    closing = float(table["omega_a_pre"][0] - table["omega_b_pre"][0])
    changes = [float(table[f"omega_{e}_post"][0] - table[f"omega_{e}_pre"][0]) for e in "ab"]
    assert changes == pytest.approx([-2 * small * closing, 2 * large * closing], rel=1e-13)


@pytest.mark.parametrize(("letter", "name"), [*zip("abc", RATIOS, strict=True)])
def test_the_page_has_the_outgoing_velocities_of_the_examples(letter: str, name: str) -> None:
    (shown,) = (row[-1] for row in rows_of("B") if row[0] == f"B example {letter}*")
    fractions = re.findall(r"[−\d]+/\d+", shown)
    table = run_of(name).collisions
    after = [float(table[f"omega_{end}_post"][0]) for end in "ab"]
    expected = [float(Fraction(one.replace("−", "-"))) for one in fractions]
    assert after == pytest.approx(expected, rel=1e-14)


def test_the_line_of_the_appendix_is_inclined() -> None:
    """B's appendix: m v̇ = −m g sin α in translation, J_P ω̇ = −m g r sin α of a ball that rolls."""
    (command,) = (row[2] for row in rows_of("B") if row[0] == "B appendix")
    words = shlex.split(command)
    overrides = [words[n + 1] for n, word in enumerate(words) if word == "--set"]
    run = simulate(load_any(words[2], overrides))
    times = np.linspace(0.0, run.collisions["t"][0], 9)
    for ball, share in ((1, 1.0), (2, 5.0 / 7.0)):
        rows = run.sample(times, side="before")
        v, s = (rows[name][rows["ball"] == ball] for name in ("speed", "s"))
        fallen = v[0] ** 2 - v**2
        np.testing.assert_allclose(fallen, share * 9.81 * (s - s[0]), rtol=1e-12, atol=1e-13)


def test_two_bodies_in_translation() -> None:
    """B (4)-(12), with 2 kg and 1 kg at 1 and -1 m/s: not equal and opposite after it."""
    run = run_of("translation")
    table = run.collisions
    after = [float(table[f"speed_{end}_post"][0]) for end in "ab"]
    assert after == pytest.approx([-1 / 3, 5 / 3], rel=1e-15)
    assert table["impulse"][0] == pytest.approx(8 / 3, rel=1e-15)
    assert table["energy_loss"][0] == pytest.approx(0.0, abs=1e-15)
    half = run_of("translation", "collision.k=0.5").collisions["energy_loss"][0]
    assert half == pytest.approx(0.5 * (1 - 0.25) * 2 / 3 * 4, rel=1e-14)  # B (9)


def test_moments_that_cancel_turn_round() -> None:
    """B II.2, third *: J1 w1 + J2 w2 = 0 gives -k w of both."""
    given = ["balls[1].omega=32", "balls[2].omega=-243", "collision.k=0.9"]
    table = run_of("horizontal_line_2_3", *given).collisions
    after = [float(table[f"omega_{end}_post"][0]) for end in "ab"]
    assert after == pytest.approx([-28.8, 218.7], rel=1e-13)


@pytest.mark.parametrize("k", [0.0, 0.3, 0.9, 1.0])
def test_generalised_theorem_of_carnot(k: float) -> None:
    """B (20), (23): the loss is (1 - k)/(1 + k) of the energy of the lost angular velocities."""
    one = CentralImpact((0.457, 0.158), (15.5, -16.3), k)
    assert one.energy_before - one.energy_after == pytest.approx(one.loss, abs=1e-12)
    assert one.carnot == pytest.approx(one.loss, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(("name", "k"), [("one_circle", 0.9), ("horizontal_line_2_3", 0.8)])
def test_carnot_of_the_tables(name: str, k: float) -> None:
    """B (18)-(20), (23) from the angular velocities in the table, with J_P = 7/5 m r^2 by hand."""
    run = run_of(name, "stop.collisions=12")
    table, bodies = run.collisions, run.system.bodies
    assert len(table["n"]) > 0
    inertia = np.array([1.4 * body.mass * body.radius**2 for body in bodies])
    before, after = (
        np.column_stack([table[f"omega_{end}_{when}"] for end in "ab"]) for when in ("pre", "post")
    )
    loss = 0.5 * np.sum(inertia * (before**2 - after**2), axis=1)
    carnot = (1.0 - k) / (1.0 + k) * 0.5 * np.sum(inertia * (after - before) ** 2, axis=1)
    np.testing.assert_allclose(table["energy_loss"], carnot, rtol=1e-11)
    np.testing.assert_allclose(loss, carnot, rtol=1e-11)
    product = inertia[0] * inertia[1] / (inertia[0] + inertia[1])
    closing = before[:, 0] - before[:, 1]
    np.testing.assert_allclose(table["impulse_moment"], (1 + k) * product * closing, rtol=1e-12)
    np.testing.assert_allclose(  # B (13)
        before @ inertia, after @ inertia, atol=1e-13 * float(np.max(np.abs(before) @ inertia))
    )


def test_a_plastic_impact_leaves_one_velocity() -> None:
    """B I.2, first *, and B (10): the loss of two bodies in translation."""
    table = run_of("translation", "collision.k=0").collisions
    after = [float(table[f"speed_{end}_post"][0]) for end in "ab"]
    assert after == pytest.approx([1 / 3, 1 / 3], rel=1e-14)
    assert table["energy_loss"][0] == pytest.approx(0.5 * (2 / 3) * 2.0**2, rel=1e-14)


def test_masses_of_the_examples() -> None:
    """B prints 4/8 for 4/3 in the masses of its balls: 4/3 pi r^3 and 28/15 pi r^5 are right."""
    body = build_any(load_any(GALLERY / "horizontal_line_1_2.toml")).bodies[0]
    assert body.mass == pytest.approx(4 / 3 * math.pi * 0.2**3 * 2700, rel=1e-15)
    assert body.rolling_inertia == pytest.approx(28 / 15 * math.pi * 0.2**5 * 2700, rel=1e-15)


def test_contact_angle() -> None:
    """A (6), B (48): their arccos in fifty digits, also in lambda_1 and lambda_2."""
    piece = build_any(load_any(GALLERY / "one_circle.toml")).trace.pieces[0]
    with mp.workdps(50):
        for one, other in ((0.1, 0.1), (0.2, 0.05), (1e-4, 2e-4)):
            r1, r2 = mp.mpf(one), mp.mpf(other)
            squares = (1 - r1) ** 2 + (1 - r2) ** 2 - (r1 + r2) ** 2
            beta = mp.acos(squares / (2 * (1 - r1) * (1 - r2)))
            first, second = 1 / r1, r2 / r1
            ratio = (first * (first - second - 1) - second) / ((first - second) * (first - 1))
            assert abs(mp.acos(ratio) - beta) < mp.mpf(10) ** -40 / beta
            assert contact_angle(piece, one, other) == pytest.approx(float(beta), rel=1e-15)


def test_circle_has_a_centre_below_and_a_saddle_above() -> None:
    """B III.3.5: with E = 2 m g (R - r) between closed and open trajectories."""
    system = build_any(load_any(GALLERY / "one_circle.toml"))
    portrait = portrait_of(Landscape.of(system, 1))
    found = {point.kind: point for point in portrait.points}
    assert sorted(found) == ["centre", "saddle"]
    assert found["centre"].position == 0.0
    assert abs(found["saddle"].position) == pytest.approx(math.pi, rel=1e-15)
    height = portrait.height(found["saddle"].energy)
    assert height == pytest.approx(2.0 * (1.0 - 0.1), rel=1e-14)
    # By B (33) a motion is open where it has a rate left at the top.
    run = run_of("one_circle", "balls[1].rate=5", "collision.k=1", "stop.collisions=12")
    table, between = run.collisions, 2.0 * 9.81 / (1.4 * 0.9)
    for end in "ab":
        for when in ("pre", "post"):
            rate = np.asarray(table[f"rate_{end}_{when}"])
            top = rate**2 - between * (1.0 + np.cos(np.asarray(table[f"angle_{end}"])))
            words = np.asarray(table[f"regime_{end}_{when}"])
            assert end == "a" or set(words.tolist()) == {"oscillating", "progressive"}
            np.testing.assert_array_equal(words == "progressive", top > 0.0)


# The papers' series


def double_sum(k: Any, u: Any) -> Any:
    """Sum of C_i C_j k^2i u^(2(i+j)+1)/(2(i+j)+1) for i, j <= 2."""
    c = [mp.mpf(1), mp.mpf(1) / 2, mp.mpf(3) / 8]
    return mp.fsum(
        c[i] * c[j] * k ** (2 * i) * u ** (2 * (i + j) + 1) / (2 * (i + j) + 1)
        for i in range(3)
        for j in range(3)
    )


def test_the_corrected_series_is_the_product_of_both_roots() -> None:
    for k, u in ((0.3, 0.4), (1.7, -0.5), (3.2, 0.3)):
        found = math.fsum(partial_sums(k, u, CORRECT))
        assert found == pytest.approx(float(double_sum(mp.mpf(k), mp.mpf(u))), rel=1e-14)


def printed_by(swing: Swing, first: Swing | None, u: float) -> float:
    return printed_time(swing, u, first)


def test_first_interval_on_the_circle_exact_printed_and_corrected() -> None:
    """A (8)-(9) for one_circle: 0.418 and 0.422 s of ball 1, 0.335 and 0.339 s of ball 2."""
    run = run_of("one_circle", "stop.collisions=1")
    expected = {"a": (0.418, 0.422), "b": (0.335, 0.339)}
    t = float(run.collisions["t"][0])
    assert t == pytest.approx(0.46423048318439, rel=1e-13)
    swings = {"a": Swing(2 * 9.81 / 1.26, -0.6, 0.5), "b": Swing(2 * 9.81 / 1.26, 0.7, 0.0)}
    for end, swing in swings.items():
        angle = float(run.collisions[f"angle_{end}"][0])
        assert turning_points(swing, angle, t) == 0
        exact = time_between(swing, angle, 0, swing.from_bottom)
        assert exact == pytest.approx(t, rel=1e-13)
        first = swings["a"] if end == "b" else None
        printed = time_between(swing, angle, 0, partial(printed_by, swing, first))
        corrected = time_between(swing, angle, 0, partial(series_time, swing))
        assert (printed, corrected) == pytest.approx(expected[end], abs=6e-4)


@pytest.mark.parametrize(
    ("angle", "rate"),
    [(1.0, 0.0), (1.0, 2.0), (0.0, 9.0), (math.pi - 1e-6, 0.0), (math.pi - 1e-9, 0.0),
     (math.pi, 1e-6), (math.pi - 1e-5, 1e-7)],
)  # fmt: skip
def test_the_period_of_a_swing_next_to_the_separatrix(angle: float, rate: float) -> None:
    """4 K(1/k)/w of B (50)-(54), or 4 K(k)/Ω where the body goes round, in 40 digits."""
    with mp.workdps(40):
        square = 2 * mp.mpf(10) * mp.sin(mp.mpf(angle) / 2) ** 2 + mp.mpf(rate) ** 2
        share = square / 20
        exact = 4 * mp.ellipk(share) / mp.sqrt(5) if share < 1 else (
            4 * mp.ellipk(1 / share) / mp.sqrt(square)
        )  # fmt: skip
    assert Swing(10.0, angle, rate).period == pytest.approx(float(exact), rel=1e-14)


@pytest.mark.parametrize("rate", [0.0, 2.0, 5.0, 6.0, 30.0])
def test_the_time_from_the_bottom(rate: float) -> None:
    """B (54): Legendre's integral F(arcsin u, k)/(Ω/2) in 40 digits; rates from 5.48 go round."""
    swing = Swing(10.0, 1.0, rate)
    with mp.workdps(40):
        scale = mp.sqrt(mp.mpf(rate) ** 2 + 20 * mp.sin(mp.mpf("0.5")) ** 2)
        for u in (-0.7, 1e-9, 0.1, 0.4):
            if u > -0.5 or rate > 2.0:  # else it turns back before
                exact = 2 * mp.ellipf(mp.asin(mp.mpf(u)), 20 / scale**2) / scale
                assert swing.from_bottom(u) == pytest.approx(float(mp.re(exact)), rel=1e-14)


def test_times_with_turning_points_are_those_of_the_run() -> None:
    run = run_of("one_circle", "collision.k=1", "stop.collisions=6")
    table = run.collisions
    for row in range(1, 6):
        lasts = float(table["dt"][row])
        for end in "ab":
            before, after = (float(table[f"angle_{end}"][n]) for n in (row - 1, row))
            rate = float(table[f"rate_{end}_post"][row - 1])
            swing = Swing(2 * 9.81 / 1.26, before, rate)
            count = turning_points(swing, after, lasts)
            found = time_between(swing, after, count, swing.from_bottom)
            assert found == pytest.approx(lasts, rel=1e-6)  # arcsin loses half the digits near 1


def valley(turns: int, **trace: Any) -> dict[str, Any]:
    """Two balls in a valley whose slopes, from −80° to 80°, are counted so many turns further."""
    first = 2.0 * math.pi * turns
    places = {"arc": 1, "radius": 0.05, "mass": 1.0}
    return {
        "gravity": 9.81,
        "trace": {
            "start_slope": first - 1.4,
            "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": first + 1.4}],
            **trace,
        },
        "balls": [
            {**places, "angle": first - 0.7, "speed": 0.3},
            {**places, "angle": first + 0.4, "speed": -0.2},
        ],
        "collision": {"k": 1.0},
        "stop": {"collisions": 4},
    }


def test_the_interval_times_are_the_same_a_turn_further(tmp_path: Path) -> None:
    """Turning points and times of the series are those of the same motion about the bottom 0."""
    runs = [simulate(Scenario.from_dict(valley(turns))) for turns in (0, 1, -1)]
    folders = [run.save(tmp_path / str(n), figures=False) for n, run in enumerate(runs)]
    rows, *others = ([[*r[:2], *r[4:]] for r in series_rows(open_run(f))] for f in folders)
    assert len(rows) == 8
    assert others == [rows, rows]


def test_the_printed_series_takes_the_constants_of_the_left_body_for_the_right_one(
    tmp_path: Path,
) -> None:
    """Impact 2 of five_balls is that of balls 2 and 3, the papers' balls 1 and 2."""
    run = simulate(example("five_balls").replace({"stop.collisions": 2}))
    table = run.collisions
    assert [table[f"ball_{end}"][1] for end in "ab"] == [2, 3]
    assert [table[f"ball_{end}"][0] for end in "ab"] == [3, 4]
    square = 2.0 * 9.81 / (1.4 * 1.9)
    left = Swing(square, -0.25, 0.0)
    right = Swing(square, float(table["angle_a"][0]), float(table["rate_a_post"][0]))
    folder = run.save(tmp_path / "run", figures=False)
    rows = [row for row in series_rows(open_run(folder)) if row[0] == "2"]
    for row, end, swing, first in zip(rows, "ab", (left, right), (None, left), strict=True):
        angle, turns = float(table[f"angle_{end}"][1]), int(row[5])
        printed = time_between(swing, angle, turns, partial(printed_by, swing, first))
        assert float(row[7].removesuffix(" s")) == pytest.approx(printed, rel=1e-4)


def test_no_interval_over_the_top_is_compared_with_the_series(tmp_path: Path) -> None:
    """On this circle a body rolls over the top, from 0.24 left of the bottom to 4.69 rad."""
    circle = {"shape": "valley", "radius": 1.0, "end_slope": 2.0 * math.pi - 1.0}
    document = valley(0, start_slope=-1.0, closed=True, arcs=[circle])
    starts = ((0.0, 9.0), (4.7, 0.0))
    for ball, (angle, speed) in zip(document["balls"], starts, strict=True):
        ball.update(angle=angle, speed=speed)
    run = simulate(Scenario.from_dict(document))
    ends = [float(run.collisions[f"angle_{end}"][3]) for end in "ab"]
    assert max(ends) > math.pi
    rows = series_rows(open_run(run.save(tmp_path / "run", figures=False)))
    assert [row[:2] for row in rows] == [["2", "1"], ["3", "2"]]


TURN = 2.0 * math.pi
LINE = {"shape": "line", "length": 0.5}
STADIUM = {
    "start_slope": -0.25 * TURN,
    "closed": True,
    "arcs": [
        {"shape": "valley", "radius": 1.0, "end_slope": 0.25 * TURN},
        LINE,
        {"shape": "valley", "radius": 1.0, "end_slope": 0.75 * TURN},
        LINE,
    ],
}
CIRCLE = [{"shape": "valley", "radius": 1.0, "end_slope": TURN - 1.0}]


@pytest.mark.parametrize(
    ("trace", "angle", "speed", "stays"),
    [
        ({}, -0.7, 0.3, True),
        ({"start_slope": TURN - 1.4, "arcs": [{**CIRCLE[0], "end_slope": TURN + 1.4}]},
         TURN - 0.7, 0.3, True),
        ({}, -0.7, 4.0, False),
        ({"start_slope": -1.0, "closed": True, "arcs": CIRCLE}, 0.0, 4.0, True),
        ({"start_slope": -1.0, "closed": True, "arcs": CIRCLE}, TURN - 1.3, 0.0, True),
        (STADIUM, 0.0, 3.0, True),
        (STADIUM, 0.0, 12.0, False),
    ],
)  # fmt: skip
def test_the_period_told_of_is_that_between_turning_points(
    trace: dict[str, Any], angle: float, speed: float, stays: bool
) -> None:
    """None is told of where the body comes to another arc, or to the end."""
    document = valley(0, **trace)
    ball = document["balls"][0] | {"angle": angle, "speed": speed}
    document |= {"balls": [ball], "stop": {"time": 6.0}, "output": {"turning_points": True}}
    del document["collision"]
    scenario = Scenario.from_dict(document)
    (body,) = quantities_of(build_any(scenario))["bodies"]
    events = simulate(scenario).events
    assert (len(set(events["arc_to"].tolist())) < 2 and "end" not in events["event"]) is stays
    turns = events["t"][events["event"] == "turning"]
    assert body["swing"]["period"] == (pytest.approx(turns[2] - turns[0]) if stays else None)


# Paper C


def test_arrival_of_disks_on_springs() -> None:
    """C (7): omega on arrival, from the energy alone, with the sign that C (5) misprints."""
    run = run_of("springs/common_origin", "stop.collisions=1")
    table, system = run.collisions, run.system
    reach = 2.0 * math.sqrt(0.3 * 0.4)
    assert table["x_b"][0] - table["x_a"][0] == pytest.approx(reach, rel=1e-14)
    for end, body in (("a", 0), ("b", 1)):
        spring, start = system.springs[body], system.initial[body]
        rate, radius = system.frequencies[body], system.bodies[body].radius
        x0, x = start.position - spring.foot, float(table[f"displacement_{end}"][0])
        roots = [math.hypot(spring.height, place) for place in (x0, x)]
        square = (start.speed / rate) ** 2 + x0**2 - x**2
        square += 2.0 * spring.length * (roots[1] - roots[0])
        omega = rate / radius * math.sqrt(square)
        assert abs(table[f"omega_{end}_pre"][0]) == pytest.approx(omega, rel=1e-11)


def test_time_of_arrival_on_springs() -> None:
    """C (6), with the sign of C (7) and the factor 1/omega_0 that it lacks, integrated."""
    run = run_of("springs/common_origin", "stop.collisions=1")
    table, spring, start = run.collisions, run.system.springs[1], run.system.initial[1]
    with mp.workdps(30):
        rate = mp.sqrt(mp.mpf(spring.stiffness) / (mp.mpf(3) / 2 * run.system.bodies[1].mass))
        x0, x1 = mp.mpf(start.position), mp.mpf(float(table["displacement_b"][0]))

        def under(x: Any, sign: int) -> Any:
            roots = mp.sqrt(spring.height**2 + x**2) - mp.sqrt(spring.height**2 + x0**2)
            return (start.speed / rate) ** 2 - (x**2 - x0**2 + sign * 2 * spring.length * roots)

        time = mp.quad(lambda x: 1 / mp.sqrt(under(x, -1)), [x1, 0, x0]) / rate
        printed = mp.quad(lambda x: 1 / mp.sqrt(abs(under(x, 1))), [x1, 0, x0])
    assert table["t"][0] == pytest.approx(float(time), rel=1e-13)
    assert abs(float(printed) / float(table["t"][0]) - 1.0) > 0.3


POINTS = [(5.0, 1.0, 4.898979485566356), (5.0, 1.5, 4.769696007084728)]


@pytest.mark.parametrize(("body", "point"), list(enumerate(POINTS)))
def test_singular_points_of_the_springs(body: int, point: tuple[float, float, float]) -> None:
    """C part 3, b*: where the force of C (4) vanishes, of its three zeros by a root finder."""
    system = build_any(load_any(GALLERY / "springs/two_disks.toml"))
    length, height, away = point
    spring = system.springs[body]
    assert (spring.length, spring.height) == (length, height)

    def force(x: Any) -> Any:
        root = mp.sqrt(height**2 + x**2)
        return x * (root - length) / root

    with mp.workdps(30):
        roots = [mp.findroot(force, guess) for guess in (-length, 0, length)]
        slopes = [mp.diff(force, root) for root in roots]
    assert float(roots[2]) == pytest.approx(away, rel=1e-15)
    record = springs_record(system, body)
    assert [one["displacement"] for one in record["points"]] == pytest.approx(
        [float(root) for root in roots], rel=1e-15, abs=1e-25
    )
    kinds = ["centre" if slope > 0 else "saddle" for slope in slopes]
    assert [one["kind"] for one in record["points"]] == kinds == ["centre", "saddle", "centre"]
    assert [one["stressed"] for one in record["points"]] == [False, True, False]
    saddle = 0.5 * spring.stiffness * (height - length) ** 2
    assert record["points"][1]["energy"] == pytest.approx(saddle, rel=1e-15)
    assert saddle == (48.0, 55.125)[body]
    assert system.frequencies[body] == pytest.approx((2.0, math.sqrt(3.0))[body], rel=1e-15)


def test_one_singular_point_stressed_or_not() -> None:
    """C part 3, a*1 (l = b, no energy) and a*2 (l < b, c (b - l)^2/2)."""
    given = ["balls[1].spring.length=1", "balls[2].spring.length=1.2"]
    system = build_any(load_any(GALLERY / "springs/two_disks.toml", given))
    points = [springs_record(system, body)["points"] for body in (0, 1)]
    assert [[one["kind"] for one in own] for own in points] == [["centre"], ["centre"]]
    assert [own[0]["stressed"] for own in points] == [False, True]
    energies = [own[0]["energy"] for own in points]
    assert energies == pytest.approx([0.0, 0.5 * 9.0 * 0.3**2], rel=1e-14)


def test_parallel_traces_touch_below_the_mean_of_the_radii() -> None:
    """A and B, conclusions: closer than 2 sqrt(r_1 r_2), not than r_1 + r_2 = 0.1 m."""
    reach = 2.0 * math.sqrt(0.06 * 0.04)
    for apart, count in ((reach - 1e-9, 1), (reach + 1e-9, 0), (0.099, 0)):
        given = [f"balls[1].y={apart!r}", "balls[2].velocity_y=0"]
        assert len(run_of("table/skew_impact", *given).collisions["n"]) == count


def test_periods_on_springs() -> None:
    """Of a run alone, from one turning point over the other back; small ones from the curvature."""
    alone = ["balls[1].position=-60", "balls[1].speed=0", "stop.time=1"]
    for given, side in (("6.5", 1.0), ("9.0", 1.0), ("12.0", 0.0)):
        system = build_any(
            load_any(
                GALLERY / "springs/two_disks.toml",
                [*alone, f"balls[2].position={given}", "balls[2].speed=0"],
            )
        )
        spring, rate = system.springs[1], system.frequencies[1]
        small, own = spring_periods(system, 2)
        share = 1.0 - (spring.height / spring.length) ** 2
        assert small == pytest.approx(2.0 * math.pi / (rate * math.sqrt(share)), rel=1e-14)
        with mp.workdps(30):
            x0 = mp.mpf(given) - spring.foot
            stretch = abs(mp.sqrt(x0**2 + spring.height**2) - spring.length)
            crosses = spring.length - stretch <= spring.height
            assert crosses == (side == 0.0)
            low = mp.sqrt((spring.length - stretch) ** 2 - spring.height**2) if not crosses else 0
            high = mp.sqrt((spring.length + stretch) ** 2 - spring.height**2)
            half, middle = (high - low) / 2, (high + low) / 2

            def speed(x: Any, reach: Any = stretch, one: Any = spring, w: Any = rate) -> Any:
                now = mp.sqrt(x**2 + one.height**2) - one.length
                return w * mp.sqrt(abs(reach**2 - now**2))

            if crosses:
                half, middle = high, mp.mpf(0)
            integral = mp.quad(
                lambda a, h=half, m=middle: h * mp.cos(a) / speed(m + h * mp.sin(a)),
                [-mp.pi / 2, 0, mp.pi / 2],
            )
        assert own == pytest.approx(float(2 * integral), rel=1e-10)


# Paper D


def test_barrier_of_the_figure_eight() -> None:
    """D: the crest stands (R + R0)(1 - cos J) over the bottoms, 1.5 (1 - cos 45°) = 0.43934 m."""
    portrait = portrait_of(Landscape.of(build_any(load_any(GALLERY / "lone_particle.toml")), 1))
    (trigger,) = portrait.triggers
    height = portrait.height(trigger.saddle.energy) - portrait.height(trigger.left.energy)
    assert height == pytest.approx(1.5 * (1.0 - math.cos(math.pi / 4.0)), rel=1e-14)
    assert trigger.orbit == "figure eight"
    # (R - r)(1 - cos 120 deg) - (R + R0)(1 - cos 45 deg), for a particle
    barrier = 1.0 * 1.5 - 1.5 * (1.0 - math.cos(math.pi / 4.0))
    for margin in (trigger.margin_left, trigger.margin_right):
        assert portrait.height(margin) == pytest.approx(barrier, rel=1e-14)


def triggers_at(name: str, rate: float, *given: str) -> list[str]:
    scenario = load_any(GALLERY / f"{name}.toml", [*given, f"trace.turning.rate={rate!r}"])
    return [one.orbit for one in portrait_of(Landscape.of(build_any(scenario), 1)).triggers]


def test_triggers_multiply_where_a_valley_lies_on_the_axis() -> None:
    """D, perspectives; the pitchfork is at Omega^2 = g/rho."""
    fork = math.sqrt(9.81 / 0.9)
    assert len(triggers_at("turning_valley", fork * (1.0 - 1e-6))) == 2
    assert len(triggers_at("turning_valley", fork * (1.0 + 1e-6))) == 3
    assert triggers_at("turning_valley", 3.8) == ["open", "figure eight", "open"]


@pytest.mark.parametrize("rate", [0.0001, 1.0, 3.0, 3.5, 5.0, 30.0])
def test_triggers_do_not_multiply_on_three_arcs(rate: float) -> None:
    """D has them do so; the figure eight opens instead."""
    assert len(triggers_at("turning_three_arcs", rate)) <= 1


def test_the_circle_that_turns_opens_its_figure_eight() -> None:
    """Pitchfork at sqrt(g/rho); its eight goes up to cos f = 2 g/(Omega^2 rho) - 1.

    That is the slope of 90 degrees where the trace ends at Omega = sqrt(2 g/rho).
    """
    rho = 0.9
    fork, opening = math.sqrt(9.81 / rho), math.sqrt(2.0 * 9.81 / rho)
    assert (fork, opening) == pytest.approx((3.301515, 4.669047), rel=1e-6)
    for share, orbits in ((1.0 - 1e-9, []), (1.0 + 1e-9, ["figure eight"])):
        assert triggers_at("turning_circle", share * fork) == orbits
    for share, orbit in ((1.0 - 1e-9, "figure eight"), (1.0 + 1e-9, "open")):
        assert triggers_at("turning_circle", share * opening) == [orbit]


@pytest.mark.parametrize(("ends", "printed"), [(90.0, 1.3045), (120.0, 2.0725)])
def test_the_three_arcs_that_turn_open_their_figure_eight(ends: float, printed: float) -> None:
    """Where the end of the trace is as high as the crest, g y - Omega^2 x^2/2 of both by hand."""
    junction, end = math.radians(50.0), math.radians(ends)
    crest = 0.5 + 0.1
    x = 1.5 * math.sin(junction) + 0.9 * math.sin(end)
    y = 1.5 * math.cos(junction) - 0.9 * math.cos(end)
    rate = math.sqrt(2.0 * 9.81 * (y - crest)) / x
    assert rate == pytest.approx(printed, abs=5e-5)
    slopes = [f'trace.start_slope="-{ends} deg"', f'trace.arcs[3].end_slope="{ends} deg"']
    for share, orbit in ((1.0 - 1e-9, "figure eight"), (1.0 + 1e-9, "open")):
        assert triggers_at("turning_three_arcs", share * rate, *slopes) == [orbit]


# The page


def commands_of_papers() -> list[str]:
    """Return the distinct commands of the page on the papers, in its order."""
    rows = [row for letter in LETTERS for row in rows_of(letter)]
    return list(dict.fromkeys(command for _, _, command, _ in rows))


@pytest.mark.usefixtures("undrawn")
def test_every_command_of_the_page_runs(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The promised figures, sections of reports and columns of tables exist."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenarios").symlink_to(GALLERY)
    for command in commands_of_papers():
        assert run_command_line(shlex.split(command)[1:]) == 0, command
    capsys.readouterr()
    for _, _, command, shown in (row for letter in LETTERS for row in rows_of(letter)):
        words = shlex.split(command)
        for section in re.findall(r"“(.+)”", shown) if words[1] == "report" else ():
            page = (tmp_path / f"{words[2]}-report.html").read_text("utf-8")
            assert section in page, (command, section)
        folder = tmp_path / results_of(words)
        for name in re.findall(r"`([\w\[\]]+)`", shown) if words[1] in ("run", "show") else ():
            names = [name.replace("[ab]", end) for end in "ab"]
            drawn = list(folder.glob(f"{name}.png"))
            tables = [folder / f"{table}.parquet" for table in ("collisions", "bounces")]
            columns = [set(pq.read_schema(path).names) for path in tables if path.exists()]
            # "_post" and the like go on with the name before them
            known = drawn or name.startswith("_") or name in ("collisions", "bounces")
            assert known or any(set(names) <= own for own in columns), (command, name)


def results_of(words: list[str]) -> Path:
    """Return the folder of the results of a command, or the folder that it reads."""
    if "-o" in words:
        return Path(words[words.index("-o") + 1])
    if words[1] == "show":
        return Path(words[2]).parent
    return Path("outputs", Path(words[2]).stem)


def test_the_page_shows_every_picture() -> None:
    page = text_of(DOCS / "papers.md")
    shown = re.findall(r"!\[.+\]\(papers/(.+)\)", page)
    pictures = list((DOCS / "papers").iterdir())
    assert sorted(shown) == sorted(picture.name for picture in pictures)
    assert sum(picture.stat().st_size for picture in pictures) < 1_500_000


def test_the_script_of_the_pictures_makes_those_of_the_page() -> None:
    """It could not be run: it imported a function that no longer existed."""
    figures = runpy.run_path(str(DOCS / "make_pictures.py"))["PAPERS"].values()
    made = [picture for pictures in figures for picture in pictures.values()]
    assert sorted(made) == sorted(picture.stem for picture in (DOCS / "papers").iterdir())


def test_figures_that_are_named_exist() -> None:
    known = {name for system in NAMES for name in system_named(system).figures}
    named = {
        kind
        for command in commands_of_papers()
        if "--figures" in command
        for kind in command.partition("--figures ")[2].split()[0].split(",")
    }
    assert named <= known


NUMBERED = {"A": 9, "B": 90, "C": 7, "D": 4}
"""The papers' last numbers of formulas; B has no (3) and no (70)."""
FIGURES = {
    "A": "1a 1b 2a 2b 2c 2d",
    "B": "1 2 3a 3b 3c 3d 4 5 6 7 8 9 A1a A1b",
    "C": "1 2a 2b 2c 3a 3b 3c 3d 4 5a 5b",
    "D": "1a 1b 1c 1d 1e",
}


def formulas_of(where: str) -> set[int]:
    """Return the numbers in brackets, including ranges such as (13)–(17)."""
    found = set()
    for first, last in re.findall(r"\((\d+)\)(?:–\((\d+)\))?", where):
        found |= set(range(int(first), int(last or first) + 1))
    return found


def figures_of(where: str) -> set[str]:
    """Return the figures, written as fig. 2b–d, fig. 2b, c, figs 3a–d, 4."""
    found: set[str] = set()
    for words in re.findall(r"figs?\.? ([^;(]+)", where):
        number = ""
        for part in filter(None, re.split(r",\s*", words)):
            match = re.fullmatch(r"(?:fig\. )?([A-Z]?\d*)([a-z]?)(?:–([a-z]))?\s*", part)
            if match is None:
                continue
            number = match[1] or number
            letters = range(ord(match[2]), ord(match[3] or match[2]) + 1) if match[2] else ()
            found |= {number + chr(letter) for letter in letters} or {number}
    return found


@pytest.mark.parametrize("letter", LETTERS)
def test_every_figure_and_formula_has_its_row(letter: str) -> None:
    rows = rows_of(letter)
    formulas = set().union(*(formulas_of(where) for where, *_ in rows))
    absent = {3, 70} if letter == "B" else set()
    assert formulas | absent == set(range(1, NUMBERED[letter] + 1))
    figures = set().union(*(figures_of(where) for where, *_ in rows))
    assert figures == set(FIGURES[letter].split())


def test_letters_are_of_the_papers() -> None:
    for letter in LETTERS:
        assert all(where.startswith(letter) for where, *_ in rows_of(letter))
        assert all(len(row) == 4 for row in rows_of(letter))
