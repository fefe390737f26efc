"""The stage of a film: the trace with the bodies, and their points in the phase plane."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from numpy.typing import NDArray

from vibro_cli.figures import style
from vibro_cli.figures.chart import body_look
from vibro_cli.figures.motion import Frames, trail
from vibro_cli.figures.plan import trace_points
from vibro_cli.figures.source import Array, Recorded
from vibro_cli.figures.ticks import number_ticks, vertical_ticks, with_power

SIZE = (6.4, 3.6)
"""Width and height (inches)."""
TRAIL = 50
"""Frames of which the points in the phase plane leave a trail."""
_WIDE = 1.7
"""A trace with a greater ratio of width to height has the phase plane below it, not beside it."""
_MARGIN = 0.06
_LEAST = 0.008
"""Least radius of a body that is drawn, as a share of the width of the plan."""
_SURFACE: dict[str, Any] = {"color": style.BLACK, "linewidth": 1.0}
_INCH = 25.4
_LARGER = 1.6
"""How much larger letters are than in print: a film is looked at on a phone too."""


class Stage:
    """A figure on which frames are drawn one after the other."""

    def __init__(self, run: Recorded, frames: Frames, dpi: float) -> None:
        self.run, self.frames = run, frames
        self.radii = [body.radius for body in run.system.bodies]
        surface = trace_points(run.system.trace)
        with style.journal(_LARGER):
            self.figure = Figure(figsize=SIZE, dpi=dpi)
            self.canvas: Any = FigureCanvasAgg(self.figure)  # its methods have no types
            self.plan, self.phase = self._panels(surface)
            self._draw_plan(surface)
            self._draw_phase()

    def _panels(self, surface: Array) -> tuple[Axes, Axes]:
        extent = np.ptp(surface, axis=0) + 2.0 * max(self.radii)
        if extent[0] > _WIDE * extent[1]:
            boxes = ((0.02, 0.52, 0.96, 0.42), (0.12, 0.19, 0.86, 0.28))
        else:
            boxes = ((0.01, 0.02, 0.48, 0.9), (0.63, 0.18, 0.35, 0.74))
        plan, phase = (self.figure.add_axes(box) for box in boxes)
        return plan, phase

    def _draw_plan(self, surface: Array) -> None:
        """Draw the trace, to scale, in the middle of its panel."""
        room = 1.1 * max(self.radii) + 0.01 * float(np.max(np.ptp(surface, axis=0)))
        low, high = surface.min(axis=0) - room, surface.max(axis=0) + room
        box = self.plan.get_position()
        size = np.array([box.width * SIZE[0], box.height * SIZE[1]])
        half = 0.5 * size * float(np.max((high - low) / size))
        middle = 0.5 * (low + high)
        self.plan.set_xlim(middle[0] - half[0], middle[0] + half[0])
        self.plan.set_ylim(middle[1] - half[1], middle[1] + half[1])
        self.plan.set_axis_off()
        self.plan.plot(surface[:, 0], surface[:, 1], **_SURFACE)
        self.drawn_radii = [max(radius, _LEAST * 2.0 * half[0]) for radius in self.radii]

    def _draw_phase(self) -> None:
        """Draw the axes of speed against arc length, as wide as the motion."""
        axes = self.phase
        box = axes.get_position()
        for values, limits in ((self.frames.s, axes.set_xlim), (self.frames.speed, axes.set_ylim)):
            low, high = float(np.min(values)), float(np.max(values))
            room = _MARGIN * (high - low) or 0.1 * abs(high) or 1.0
            limits(low - room, high + room)
        across = number_ticks(*axes.get_xlim(), box.width * SIZE[0] * _INCH / _LARGER)
        along = vertical_ticks(*axes.get_ylim(), box.height * SIZE[1] * _INCH / _LARGER)
        axes.set_xticks(across.places, across.labels)
        axes.set_yticks(along.places, along.labels)
        axes.set_xlabel(f"$s$ [{with_power('m', across)}]")
        axes.set_ylabel(f"$v$ [{with_power('m/s', along)}]", labelpad=1.0)
        for piece in self.run.system.trace.pieces[1:]:
            axes.axvline(piece.start_s, color=style.LEVEL_GREY, linewidth=0.5, zorder=0.8)

    def place(self, axes: Axes) -> tuple[float, float, float, float]:
        """Return a, b, c, d of x' = a + b x, y' = c + d y: pixels from the upper left corner."""
        box = axes.get_position()
        wide, high = (side * self.figure.dpi for side in SIZE)
        (left, right), (low, top) = axes.get_xlim(), axes.get_ylim()
        b = box.width * wide / (right - left)
        d = -box.height * high / (top - low)
        return box.x0 * wide - b * left, b, (1.0 - box.y1) * high - d * top, d


class Film(Stage):
    """A stage whose frames are taken as pictures: what does not move is drawn once."""

    def __init__(self, run: Recorded, frames: Frames, dpi: float) -> None:
        super().__init__(run, frames, dpi)
        with style.journal():
            self.canvas.draw()
            self._still = self.canvas.copy_from_bbox(self.figure.bbox)
            self._moving = [self._body(n) for n in range(len(self.radii))]
            size = _LARGER * style.TEXT
            self._clock = self.figure.text(0.02, 0.95, "", fontsize=size, va="center")
        self._trails = [trail(run, frames, body) for body in range(len(self.radii))]

    def _body(self, body: int) -> tuple[Circle, Line2D, Line2D, Line2D]:
        colour = body_look(body + 1)["color"]
        look: dict[str, Any] = {"facecolor": colour, "edgecolor": style.BLACK, "linewidth": 0.6}
        disk = Circle((0.0, 0.0), self.drawn_radii[body], **look)
        self.plan.add_patch(disk)
        (spoke,) = self.plan.plot([], [], color="white", linewidth=1.0)
        dashes = body_look(body + 1)["linestyle"]
        (line,) = self.phase.plot([], [], color=colour, linewidth=0.8, linestyle=dashes)
        (point,) = self.phase.plot([], [], marker="o", markersize=4.0, color=colour)
        return disk, spoke, line, point

    def _past(self, frame: int, body: int) -> tuple[Array, Array]:
        """Return the last part of a body's trail (m, m/s)."""
        way, times = self._trails[body], self.frames.time
        begins = max(times[max(0, frame - TRAIL)], times[frame] - self.frames.between.span)
        first = int(np.searchsorted(way.time, begins))
        last = int(np.searchsorted(way.time, times[frame], side="right"))
        return way.s[first:last], way.speed[first:last]

    def picture(self, frame: int) -> NDArray[np.uint8]:
        """Return a frame, shape (height, width, 3)."""
        states = self.frames
        self.canvas.restore_region(self._still)
        self._clock.set_text(f"$t = {states.time[frame]:.3f}$ s")
        with style.journal():
            for body, (disk, spoke, line, point) in enumerate(self._moving):
                x, y = states.x[frame, body], states.y[frame, body]
                disk.set_center((x, y))
                turned = states.turn[frame, body]
                reach = 0.85 * self.drawn_radii[body]
                spoke.set_data([x, x + reach * math.sin(turned)], [y, y + reach * math.cos(turned)])
                line.set_data(*self._past(frame, body))
                point.set_data([states.s[frame, body]], [states.speed[frame, body]])
                for axes, artist in (
                    (self.plan, disk),
                    (self.plan, spoke),
                    (self.phase, line),
                    (self.phase, point),
                ):
                    axes.draw_artist(artist)
            self._clock.draw(self.canvas.get_renderer())
        picture: NDArray[np.uint8] = np.array(self.canvas.buffer_rgba())[:, :, :3]
        return picture
