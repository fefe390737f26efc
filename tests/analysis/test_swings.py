"""Whether a swing stays on its arc, against the motion integrated in time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from vibro_cli.analysis.paper_formulas import Swing, stays
from vibro_cli.mechanics.trace import ArcShape, Piece, Trace

SQUARE = 15.0
"""Square of ω = √(2g/κρ) (1/s²)."""
SEPARATRIX = math.sqrt(2.0 * SQUARE)
"""Rate at the bottom (rad/s) with which a body just reaches the top."""


def arc(low: float, high: float) -> Piece:
    """Return a valley between two slopes in degrees."""
    shape = ArcShape("valley", radius=1.0, end_slope=math.radians(high))
    return Trace.chain(math.radians(low), [shape]).pieces[0]


@pytest.mark.parametrize("slopes", [(-60.0, 100.0), (-100.0, 60.0), (260.0, 420.0)])
@pytest.mark.parametrize(
    ("angle", "rate"), [(0.9, 0.0), (1.2, 0.0), (0.3, 2.0), (0.3, 3.5), (-0.9, 0.5), (0.0, 6.0)]
)
def test_a_swing_stays_between_its_turning_points(
    slopes: tuple[float, float], angle: float, rate: float
) -> None:
    piece = arc(*slopes)
    angle += 2.0 * math.pi * (slopes[0] > 180.0)

    def change(_: float, state: np.ndarray) -> list[float]:
        return [state[1], -0.5 * SQUARE * math.sin(state[0])]

    reached = solve_ivp(change, (0.0, 6.0), [angle, rate], rtol=1e-9, max_step=0.01).y[0]
    within = piece.angle_start <= np.min(reached) and np.max(reached) <= piece.angle_end
    assert stays(Swing(SQUARE, angle, rate), piece, circle=False) == within


@pytest.mark.parametrize(
    ("slopes", "way", "within"),
    [
        ((-100.0, 185.0), 1.0, True), ((-100.0, 185.0), -1.0, False),
        ((-185.0, 100.0), 1.0, False), ((-185.0, 100.0), -1.0, True),
        ((-170.0, 170.0), 1.0, False),
    ],
)  # fmt: skip
def test_on_the_separatrix_the_top_ahead_decides(
    slopes: tuple[float, float], way: float, within: bool
) -> None:
    swing = Swing(SQUARE, 0.0, way * SEPARATRIX)
    assert swing.below == 0.0
    assert stays(swing, arc(*slopes), circle=False) == within
