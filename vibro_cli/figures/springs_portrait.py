"""Phase portrait of a body on a spring, and below it its energies (C fig. 5).

In the portrait: level curves, separatrix, singular points, the branches of the run and the jumps at
its impacts. Below: the energy of the spring over the same place, and the body's total energy, which
stays between impacts and jumps with the speed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vibro_cli.figures import style
from vibro_cli.systems.springs.run import SpringsRun
from vibro_cli.systems.springs.system import SpringsSystem, separatrix_speed, singular_points

SAMPLES = 1500
"""Times at which the motion is drawn."""
LEVELS = 9
"""Level curves of the energy behind the branches."""

Floats = NDArray[np.float64]


def springs_portrait(run: SpringsRun, ball: int, width: str = "single") -> Figure:
    """Return speed and energies over the displacement of a body (from 1) of a run.

    `width` is `single` (85 mm) or `double` (170 mm).
    Raises IndexError for a body that is not there.
    """
    if not 1 <= ball <= len(run.system.bodies):
        raise IndexError(f"no body {ball}: the run has {len(run.system.bodies)}")
    path = _path(run, ball - 1)
    with style.journal():
        figure, upper, lower = _panels(width)
        span = _span(run, ball - 1, path)
        fastest = float(np.max(np.abs(path["speed"]))) or 1.0
        _draw_background(upper, run.system, ball - 1, span, fastest)
        _draw_branches(upper, path)
        _draw_spring_energy(lower, run.system, ball - 1, span)
        _draw_energies(lower, path)
        _label(upper, lower, ball, span)
        count = len(path["jump_x"])
        words = f"{count} {'impact' if count == 1 else 'impacts'} of body {ball}"
        upper.set_title(words, pad=2.0, color=style.FRAME_GREY)
    return figure


def springs_structure(system: SpringsSystem, ball: int, width: str = "single") -> Figure:
    """Return the portrait of a body (from 1) without a run: levels, separatrix, singular points.

    Below it the energy of the spring, with those of the singular points.
    """
    spring, w = system.springs[ball - 1], system.frequency(ball - 1)
    points = singular_points(spring)
    b, length = spring.height, spring.length
    # The whole of the separatrix, which ends where the spring is as long as 2 l - b.
    reach = 1.12 * math.sqrt((2.0 * length - b) ** 2 - b * b) if len(points) == 3 else 1.7 * b
    span = -reach, reach
    with style.journal():
        figure, upper, lower = _panels(width)
        fastest = 1.35 * w * max(length - b, 0.5 * reach)
        _draw_background(upper, system, ball - 1, span, fastest)
        _draw_spring_energy(lower, system, ball - 1, span)
        for place, kind in points:
            energy = spring.energy(place)
            look: dict[str, Any] = {"color": style.SEPARATRIX_GREY, "linewidth": 0.6}
            if kind == "saddle":
                lower.axhline(energy, label="of the separatrix", dashes=(4, 2), **look)
            lower.plot(place, energy, "x" if kind == "saddle" else "o", color=style.BLACK,
                       markersize=3.5, fillstyle="none", zorder=5.0)  # fmt: skip
        lower.set_ylim(0.0, 1.3 * max(spring.energy(0.0), 0.8 * spring.energy(reach)))
        lower.legend(loc="upper center", ncols=2)
        _label(upper, lower, ball, span)
    return figure


def _panels(width: str) -> tuple[Figure, Axes, Axes]:
    figure = Figure(figsize=(style.WIDTHS[width] * style.MM, 105.0 * style.MM))
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.4, 1.0))
    figure.subplots_adjust(0.13, 0.09, 0.98, 0.96, hspace=0.06)
    return figure, upper, lower


def _label(upper: Axes, lower: Axes, ball: int, span: tuple[float, float]) -> None:
    upper.set_ylabel(rf"$\dot{{x}}_{{{ball}}}$ [m/s]")
    lower.set_ylabel(r"energy [J]")
    lower.set_xlabel(rf"$x_{{{ball}}}$ [m], from the foot of its spring")
    upper.set_xlim(*span)


def _path(run: SpringsRun, index: int) -> dict[str, Floats]:
    """Sampled motion of a body, and its impacts."""
    times = np.linspace(0.0, run.end_time, SAMPLES)
    state = run.sample(times)
    rows = run.collisions
    number = len(run.system.bodies)
    path = {name: state[name][index::number] for name in ("displacement", "speed", "energy")}
    jumps: dict[str, list[Floats]] = {"t": [], "x": [], "pre": [], "post": []}
    for end in "ab":
        own = rows[f"ball_{end}"] == index + 1
        columns = ("t", f"displacement_{end}", f"speed_{end}_pre", f"speed_{end}_post")
        for name, column in zip(jumps, columns, strict=True):
            jumps[name].append(rows[column][own])
    order = np.argsort(np.concatenate(jumps["t"]), kind="stable")
    found = {f"jump_{name}": np.concatenate(parts)[order] for name, parts in jumps.items()}
    return path | found | {"times": times}


def _span(run: SpringsRun, index: int, path: dict[str, Floats]) -> tuple[float, float]:
    """The part of the axis that is drawn: where the body went, and its singular points."""
    places = [place for place, _ in singular_points(run.system.springs[index])]
    low = min(float(np.min(path["displacement"])), *places)
    high = max(float(np.max(path["displacement"])), *places)
    margin = 0.08 * (high - low) or 1.0
    return low - margin, high + margin


def _draw_background(
    axes: Axes, system: SpringsSystem, index: int, span: tuple[float, float], fastest: float
) -> None:
    """Level curves up to a speed (m/s), singular points, separatrix."""
    spring, w = system.springs[index], system.frequency(index)
    x = np.linspace(*span, 600)
    stored = (w * (np.hypot(spring.height, x) - spring.length)) ** 2
    v = np.linspace(-1.15 * fastest, 1.15 * fastest, 300)
    levels = np.linspace(0.0, float(np.max(stored)) + fastest**2, LEVELS + 2)[1:-1]
    energy = stored[None, :] + v[:, None] ** 2
    axes.contour(x, v, energy, levels=levels, colors=style.LEVEL_GREY, linewidths=0.4)
    axes.set_ylim(v[0], v[-1])
    for place, kind in singular_points(spring):
        mark = {"center": "o", "saddle": "x"}[kind]
        axes.plot(place, 0.0, mark, color=style.BLACK, markersize=3.5, fillstyle="none", zorder=5.0)
    if len(singular_points(spring)) == 3:
        through = np.array([separatrix_speed(spring, w, float(place)) for place in x])
        for sign in (1.0, -1.0):
            axes.plot(x, sign * through, color=style.SEPARATRIX_GREY, linewidth=0.8, dashes=(4, 2))


def _draw_branches(axes: Axes, path: dict[str, Floats]) -> None:
    """The motion between impacts, and the vertical jumps at them."""
    number = np.searchsorted(path["jump_t"], path["times"], side="right")
    for branch in range(len(path["jump_t"]) + 1):
        rows = number == branch
        x, v = path["displacement"][rows], path["speed"][rows]
        if branch > 0:
            x = np.append(path["jump_x"][branch - 1], x)
            v = np.append(path["jump_post"][branch - 1], v)
        if branch < len(path["jump_t"]):
            x = np.append(x, path["jump_x"][branch])
            v = np.append(v, path["jump_pre"][branch])
        axes.plot(x, v, color=style.BLUE, linewidth=0.8, zorder=3.0)
    for x, before, after in zip(path["jump_x"], path["jump_pre"], path["jump_post"], strict=True):
        axes.plot([x, x], [before, after], color=style.VERMILLION, linewidth=0.7, zorder=4.0)
    axes.plot(path["displacement"][0], path["speed"][0], "s", color=style.BLUE, markersize=3.0)


def _draw_spring_energy(
    axes: Axes, system: SpringsSystem, index: int, span: tuple[float, float]
) -> None:
    spring = system.springs[index]
    x = np.linspace(*span, 600)
    stored = 0.5 * spring.stiffness * (np.hypot(spring.height, x) - spring.length) ** 2
    axes.plot(x, stored, color=style.GREEN, linewidth=1.0, label="of the spring")


def _draw_energies(axes: Axes, path: dict[str, Floats]) -> None:
    """The total energy of each branch of a run."""
    number = np.searchsorted(path["jump_t"], path["times"], side="right")
    label: str | None = "total"
    for branch in range(len(path["jump_t"]) + 1):
        rows = number == branch
        if np.any(rows):
            place, energy = path["displacement"][rows], path["energy"][rows]
            axes.plot(place, energy, color=style.BLUE, linewidth=0.6, label=label)
            label = None
    axes.set_ylim(0.0, 1.25 * float(np.max(path["energy"])) or 1.0)
    axes.legend(loc="upper center", ncols=2)
