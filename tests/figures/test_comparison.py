"""Particle, disk and ball in one figure: curves of equal height, rates as 1/√κ (D)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from tests.analysis.traces import BALL, circle, landscape, line, three_arcs, valley
from tests.figures.layout import WIDTHS, assert_texts_are_apart, texts
from vibro_cli.analysis.singular import Portrait, portrait_of
from vibro_cli.figures.portraits.trace_phase_plane import comparison, family

PARTICLE = replace(BALL, kind="particle", inertia_ratio=0.0)
DISK = replace(BALL, kind="disk", inertia_ratio=0.5, mass=7.0)
LINES = (-60.0, valley(1.0, 0), line(1.5), valley(1.0, 60))


def members(make: Any = three_arcs) -> list[tuple[str, Portrait]]:
    return [(one.kind, portrait_of(make(body=one))) for one in (PARTICLE, DISK, BALL)]


def curves(figure: Figure, panel: int) -> list[list[Any]]:
    """Return the lines of each body on a panel."""
    groups = [one for one in figure.axes[panel].collections if isinstance(one, LineCollection)]
    return [list(group.get_segments()) for group in groups]


def test_rates_are_as_one_over_the_root_of_kappa() -> None:
    figure = comparison(members())
    for panel in range(4):
        particle, disk, ball = curves(figure, panel)
        for kappa, others in ((1.5, disk), (1.4, ball)):
            assert len(others) == len(particle) > 2
            for one, other in zip(particle, others, strict=True):
                np.testing.assert_allclose(other[:, 0], one[:, 0], atol=1e-12)
                scaled = math.sqrt(kappa) * other[:, 1]
                np.testing.assert_allclose(scaled, one[:, 1], rtol=1e-7, atol=1e-7)


def test_energy_is_constant_along_every_curve() -> None:
    for (_, portrait), panel in ((one, panel) for one in members() for panel in range(3)):
        figure = comparison([("it", portrait)])
        hills = portrait.landscape
        (own,) = curves(figure, panel)
        for curve in own:
            energy = hills.energy(hills.trace.pieces[panel], curve[:, 0], curve[:, 1])
            np.testing.assert_allclose(energy, energy[0], rtol=1e-12)


def test_the_bodies_are_named_with_their_kappa() -> None:
    shown = {text.get_text() for text in texts(comparison(members()))}
    assert {r"particle, $\kappa = 1$", r"disk, $\kappa = 1.5$", r"ball, $\kappa = 1.4$"} <= shown


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("make", [three_arcs, circle, lambda body: landscape(*LINES, body=body)])
def test_no_text_is_cut_off_or_overlaps_another(make: Any, width: str) -> None:
    assert_texts_are_apart(comparison(members(make), width))


def test_the_junctions_are_marked_along_the_trace() -> None:
    """They lie at the sums of radius times angle."""
    figure = comparison(members())
    lines = [np.asarray(line.get_xdata()) for line in figure.axes[-1].lines]
    upright = sorted(float(x[0]) for x in lines if len(x) == 2 and x[0] == x[1])
    pieces = three_arcs().trace.pieces
    lengths = [one.radius * (one.angle_end - one.angle_start) for one in pieces]
    assert upright == pytest.approx(np.cumsum(lengths)[:-1], rel=1e-12)


def test_one_level_line_in_a_family_is_explained() -> None:
    """The equilibria of the other members are single points."""
    level = portrait_of(landscape(*LINES))
    tilted = portrait_of(landscape(-60.0, valley(1.0, 10), line(1.5), valley(1.0, 60)))
    for both in ((level, tilted), (tilted, level), (tilted, tilted)):
        figure = family([(str(number), one) for number, one in enumerate(both)])
        explained = "line of equilibria" in [text.get_text() for text in texts(figure)]
        assert explained == (level in both)


def test_too_few_and_too_many_are_refused() -> None:
    for number in (0, 7):
        with pytest.raises(ValueError, match=f"found {number}"):
            comparison(members()[:1] * number)
