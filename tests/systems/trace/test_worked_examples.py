"""Paper B's worked examples a*, b*, c*, with the large coefficient on the smaller ball.

Balls of one density have J_P as r^5; by B (15)-(16) the coefficient of a ball is 1/(1 + J/J') with
its own J first: 32/33, 243/244, 243/275 belong to the smaller one.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from vibro_cli.api import simulate
from vibro_cli.scenario import load_any
from vibro_cli.systems.run import Run

FOLDER = Path(__file__).parents[3] / "scenarios"
# (coefficient of the larger ball, of the smaller one, J_P larger/J_P smaller, speeds, k)
Example = tuple[Fraction, Fraction, Fraction, tuple[int, int], Fraction]
EXAMPLES: dict[str, Example] = {
    "horizontal_line_1_2": (Fraction(1, 33), Fraction(32, 33), Fraction(32), (1, 0), Fraction(1)),
    "horizontal_line_1_3": (
        Fraction(1, 244), Fraction(243, 244), Fraction(243), (0, -1), Fraction(1),
    ),
    "horizontal_line_2_3": (
        Fraction(32, 275), Fraction(243, 275), Fraction(243, 32), (2, -3), Fraction(4, 5),
    ),
}  # fmt: skip


def row(name: str, engine: str) -> tuple[Run, dict[str, Fraction]]:
    """The one impact of an example."""
    run = simulate(load_any(FOLDER / f"{name}.toml"), engine)
    table = run.collisions
    assert len(table["n"]) == 1
    assert bool(table["admissible"][0])
    names = [column for column in table if table[column].dtype == float]
    finite = [column for column in names if table[column][0] == table[column][0]]
    return run, {column: Fraction(float(table[column][0])) for column in finite}


@pytest.mark.parametrize("name", EXAMPLES)
def test_outgoing_angular_velocities(name: str, engine: str) -> None:
    large, small, _, (one, two), k = EXAMPLES[name]
    _, found = row(name, engine)
    assert found["omega_a_pre"] == pytest.approx(one, abs=1e-15)
    assert found["omega_b_pre"] == pytest.approx(two, abs=1e-15)
    expected_a = one - (1 + k) * large * (one - two)
    expected_b = two + (1 + k) * small * (one - two)
    assert abs(found["omega_a_post"] - expected_a) <= Fraction(1, 10**15) * max(
        Fraction(1), abs(expected_a)
    )
    assert abs(found["omega_b_post"] - expected_b) <= Fraction(1, 10**15) * max(
        Fraction(1), abs(expected_b)
    )


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_coefficients_are_those_of_the_radii(name: str, engine: str) -> None:
    large, small, ratio, (one, two), k = EXAMPLES[name]
    _, found = row(name, engine)
    assert large == 1 / (1 + ratio)
    assert small == 1 / (1 + 1 / ratio)
    assert large + small == 1
    change = (1 + k) * (one - two)
    assert abs((one - found["omega_a_post"]) / change - large) <= Fraction(1, 10**15)
    assert abs((found["omega_b_post"] - two) / change - small) <= Fraction(1, 10**15)


@pytest.mark.parametrize("name", EXAMPLES)
def test_invariants(name: str, engine: str) -> None:
    _, _, ratio, (one, two), k = EXAMPLES[name]
    run, found = row(name, engine)
    bodies = [
        Fraction(7, 5) * Fraction(body.mass) * Fraction(body.radius) ** 2
        for body in run.system.bodies
    ]
    ja, jb = bodies
    assert float(ja / jb) == pytest.approx(float(ratio), rel=2e-15)
    before = ja * found["omega_a_pre"] + jb * found["omega_b_pre"]
    after = ja * found["omega_a_post"] + jb * found["omega_b_post"]
    scale = ja * max(map(abs, (one, two)))
    tolerance = Fraction(1, 10**15)
    assert abs(after - before) <= tolerance * scale  # B (13)
    parting = found["omega_b_post"] - found["omega_a_post"]
    assert abs(parting - k * (one - two)) <= 3 * tolerance * abs(one - two)  # B (14)
    moment = (1 + k) * ja * jb / (ja + jb) * (one - two)
    assert abs(found["impulse_moment"] - moment) <= 2 * tolerance * abs(moment)  # B (17)
    loss = (1 - k**2) / 2 * ja * jb / (ja + jb) * (one - two) ** 2
    assert abs(found["energy_loss"] - loss) <= 2 * tolerance * loss  # B (20)
    changes = (
        ja * (found["omega_a_post"] - found["omega_a_pre"]) ** 2
        + jb * (found["omega_b_post"] - found["omega_b_pre"]) ** 2
    ) / 2
    carnot = (1 - k) / (1 + k) * changes
    assert abs(found["energy_loss"] - carnot) <= 4 * tolerance * carnot  # B (23)


def test_the_misprint_would_break_the_moment_of_momentum() -> None:
    """With the coefficients exchanged, as B prints them, B (13) fails: the test can tell."""
    _, found = row("horizontal_line_1_2", "python")
    large, small, ratio, (one, two), k = EXAMPLES["horizontal_line_1_2"]
    misprinted = ratio * (one - (1 + k) * small * (one - two)) + two + (1 + k) * large * (one - two)
    assert misprinted != ratio * one + two
    exact = ratio * found["omega_a_post"] + found["omega_b_post"]
    assert abs(exact - (ratio * one + two)) < Fraction(1, 10**13)
