"""What the papers say in numbers, recomputed; and the page that says which command shows it."""

from __future__ import annotations

import math
import re
import shlex
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpmath import mp

from tests.pages import DOCS, ROOT, text_of
from vibro_cli.analysis.central_impact import CentralImpact
from vibro_cli.analysis.landscape import Landscape
from vibro_cli.analysis.portrait_type import portrait_of
from vibro_cli.analysis.swings import (
    CORRECT,
    Swing,
    contact_angle,
    partial_sums,
    printed_time,
    series_time,
)
from vibro_cli.api import simulate
from vibro_cli.build import build_any as assembled
from vibro_cli.commands.app import run_command_line
from vibro_cli.commands.papers import A, B, C, D, commands
from vibro_cli.report.series import time_between, turning_points
from vibro_cli.scenario import load_any
from vibro_cli.systems import system_named
from vibro_cli.systems.springs.periods import spring_periods

FOLDER = ROOT / "scenarios"


def build_any(scenario: Any) -> Any:
    """The system of a scenario, of whatever kind."""
    return assembled(scenario)


def run_of(name: str, *overrides: str) -> Any:
    return simulate(load_any(FOLDER / f"{name}.toml", [*overrides]))


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


def test_masses_of_the_examples() -> None:
    """B prints 4/8 for 4/3 in the masses of its balls: 4/3 pi r^3 and 28/15 pi r^5 are right."""
    body = build_any(load_any(FOLDER / "horizontal_line_1_2.toml")).bodies[0]
    assert body.mass == pytest.approx(4 / 3 * math.pi * 0.2**3 * 2700, rel=1e-15)
    assert body.rolling_inertia == pytest.approx(28 / 15 * math.pi * 0.2**5 * 2700, rel=1e-15)


def test_contact_angle() -> None:
    """A (6), B (48): their arccos in fifty digits, also in lambda_1 and lambda_2."""
    piece = build_any(load_any(FOLDER / "one_circle.toml")).trace.pieces[0]
    with mp.workdps(50):
        for one, other in ((0.1, 0.1), (0.2, 0.05), (1e-4, 2e-4)):
            r1, r2 = mp.mpf(one), mp.mpf(other)
            squares = (1 - r1) ** 2 + (1 - r2) ** 2 - (r1 + r2) ** 2
            beta = mp.acos(squares / (2 * (1 - r1) * (1 - r2)))
            first, second = 1 / r1, r2 / r1
            ratio = (first * (first - second - 1) - second) / ((first - second) * (first - 1))
            assert abs(mp.acos(ratio) - beta) < mp.mpf(10) ** -40 / beta
            assert contact_angle(piece, (one, other)) == pytest.approx(float(beta), rel=1e-15)


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


# Paper C


def test_arrival_of_disks_on_springs() -> None:
    """C (7): omega on arrival, from the energy alone, with the sign that C (5) misprints."""
    run = run_of("springs/common_origin", "stop.collisions=1")
    table, system = run.collisions, run.system
    reach = 2.0 * math.sqrt(0.3 * 0.4)
    assert table["x_b"][0] - table["x_a"][0] == pytest.approx(reach, rel=1e-14)
    for end, body in (("a", 0), ("b", 1)):
        spring, start = system.springs[body], system.initial[body]
        rate, radius = system.frequency(body), system.bodies[body].radius
        x0, x = start.position - spring.foot, float(table[f"displacement_{end}"][0])
        roots = [math.hypot(spring.height, place) for place in (x0, x)]
        square = (start.speed / rate) ** 2 + x0**2 - x**2
        square += 2.0 * spring.length * (roots[1] - roots[0])
        omega = rate / radius * math.sqrt(square)
        assert abs(table[f"omega_{end}_pre"][0]) == pytest.approx(omega, rel=1e-11)


def test_singular_points_of_the_springs() -> None:
    """C part 3, b*: centres at -+ sqrt(l^2 - b^2), the saddle's spring holds c (b - l)^2/2."""
    system = build_any(load_any(FOLDER / "springs/two_disks.toml"))
    assert system.frequency(0) == 2.0
    assert system.frequency(1) == pytest.approx(math.sqrt(3.0), rel=1e-15)
    assert [spring.energy(0.0) for spring in system.springs] == [48.0, 55.125]


def test_periods_on_springs() -> None:
    """Of a run alone, from one turning point over the other back; small ones from the curvature."""
    alone = ["balls[1].position=-60", "balls[1].speed=0", "stop.time=1"]
    for given, side in (("6.5", 1.0), ("9.0", 1.0), ("12.0", 0.0)):
        system = build_any(
            load_any(
                FOLDER / "springs/two_disks.toml",
                [*alone, f"balls[2].position={given}", "balls[2].speed=0"],
            )
        )
        spring, rate = system.springs[1], system.frequency(1)
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
    portrait = portrait_of(Landscape.of(build_any(load_any(FOLDER / "lone_particle.toml")), 1))
    (trigger,) = portrait.triggers
    height = portrait.height(trigger.saddle.energy) - portrait.height(trigger.left.energy)
    assert height == pytest.approx(1.5 * (1.0 - math.cos(math.pi / 4.0)), rel=1e-14)
    assert trigger.orbit == "figure eight"


def triggers_at(name: str, rate: float) -> list[str]:
    scenario = load_any(FOLDER / f"{name}.toml", [f"trace.turning.rate={rate!r}"])
    return [one.orbit for one in portrait_of(Landscape.of(build_any(scenario), 1)).triggers]


def test_triggers_multiply_where_a_valley_lies_on_the_axis() -> None:
    """D, perspectives; the pitchfork is at Omega^2 = g/rho."""
    fork = math.sqrt(9.81 / 0.9)
    assert len(triggers_at("turning_valley", fork * (1.0 - 1e-6))) == 2
    assert len(triggers_at("turning_valley", fork * (1.0 + 1e-6))) == 3
    assert "figure eight" in triggers_at("turning_valley", 3.4)


@pytest.mark.parametrize("rate", [0.0001, 1.0, 3.0, 3.5, 5.0, 30.0])
def test_triggers_do_not_multiply_on_three_arcs(rate: float) -> None:
    """D has them do so; the figure eight opens instead."""
    assert len(triggers_at("turning_three_arcs", rate)) <= 1


def test_the_circle_that_turns_opens_its_figure_eight() -> None:
    """Pitchfork at sqrt(g/rho), and the eight reaches the top at sqrt(2 g/rho)."""
    rho = 0.9
    for share, count in ((0.999999, 0), (1.000001, 1)):
        assert len(triggers_at("turning_circle", share * math.sqrt(9.81 / rho))) == count


# The page


def test_every_command_of_the_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenarios").symlink_to(FOLDER)
    for command in commands():
        assert run_command_line(shlex.split(command)[1:]) == 0, command
    capsys.readouterr()
    for _, _, command, shown in (*A, *B, *C, *D):
        words = shlex.split(command)
        kinds = words[words.index("--figures") + 1].split(",") if "--figures" in words else []
        for name in re.findall(r"`(\w+)`", shown):
            if name.rstrip("_0123456789") not in kinds:
                continue
            stem = Path(words[2]).stem if "-o" not in words else Path(words[-1]).name
            found = [*Path("outputs", stem).glob(f"{name}*.png")]
            assert found, (command, name)


def test_the_page_shows_every_picture() -> None:
    page = text_of(DOCS / "papers.md")
    shown = re.findall(r"!\[.+\]\(papers/(.+)\)", page)
    pictures = list((DOCS / "papers").iterdir())
    assert sorted(shown) == sorted(picture.name for picture in pictures)
    assert sum(picture.stat().st_size for picture in pictures) < 1_500_000


def test_figures_that_are_named_exist() -> None:
    known = {
        name for system in ("trace", "table", "springs") for name in system_named(system).figures
    }
    named = {
        kind
        for command in commands()
        if "--figures" in command
        for kind in command.partition("--figures ")[2].split()[0].split(",")
    }
    assert named <= known


def test_letters_are_of_the_papers() -> None:
    for letter, rows in (("A", A), ("B", B), ("C", C), ("D", D)):
        assert all(where.startswith(letter) for where, *_ in rows)
    assert np.all([len(row) == 4 for row in (*A, *B, *C, *D)])
