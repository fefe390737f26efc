"""Films as files: GIF by Pillow, MP4 by the program ffmpeg.

The stage shows the trace with the bodies, and their points in the phase plane; their states at the
times of the frames are in closed form.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from numpy.typing import NDArray

from vibro_cli.errors import VibroError
from vibro_cli.figures import style
from vibro_cli.figures.chart import body_look
from vibro_cli.figures.runs.plan import draw_ends, trace_points
from vibro_cli.figures.source import Array, Recorded
from vibro_cli.figures.ticks import number_ticks, vertical_ticks, with_power
from vibro_cli.mechanics.system import PARTICLE, Body, System
from vibro_cli.mechanics.trace import Trace

_PER_PERIOD = 64
"""Points of a trail in a period."""


class Moving(Recorded, Protocol):
    """A finished run whose motion can be had at any time."""

    def sample(self, times: Any) -> dict[str, Any]:
        """The motion of every body at given times (s)."""


@dataclass(frozen=True)
class Frames:
    """States at the times of frames; arrays of shape (frames, bodies) but for the times."""

    time: Array
    """Times (s), shape (frames,)."""
    x: Array
    """Horizontal place of the centre (m)."""
    y: Array
    """Height of the centre (m)."""
    s: Array
    """Arc length of the contact point (m)."""
    speed: Array
    """Signed speed of the centre (m/s)."""
    turn: Array
    """Angle (rad) by which the body has turned since the first frame, clockwise."""
    between: Between
    """What the trails have more than the frames."""


@dataclass(frozen=True)
class Between:
    """States between frames that lie too far apart for a line through them to be the motion."""

    time: Array
    """Times (s), shape (instants,), rising."""
    s: Array
    """Arc length of the contact points (m), shape (instants, bodies)."""
    speed: Array
    """Signed speeds of the centres (m/s), the same shape."""
    span: float
    """How far back a trail goes (s): longer ones would cover one another."""


def frame_times(start: float, end: float, pace: float, rate: int) -> Array:
    """Return the times (s) of frames from `start` to `end`.

    `pace` is the motion's time per film's time, `rate` the frames of a film's second.
    """
    step = pace / rate
    number = math.floor((end - start) / step * (1.0 + 1e-12)) + 1
    times: Array = np.minimum(start + step * np.arange(number), end)
    return times


def frames(run: Moving, times: Array) -> Frames:
    """Return the states of all bodies at the times of frames.

    Nothing is interpolated: each state is that of its flight in closed form. On a closed trace the
    bodies must not run half of it from frame to frame, or their turning is not right.
    """
    bodies = run.system.bodies
    sampled = run.sample(times)

    def table(name: str) -> Array:
        return np.asarray(sampled[name], dtype=np.float64).reshape(len(times), len(bodies))

    arc = np.asarray(sampled["arc"]).reshape(len(times), len(bodies)) - 1
    s = table("s")
    turn = np.column_stack(
        [_turned(run.system.trace, body, arc[:, n], s[:, n]) for n, body in enumerate(bodies)]
    )
    between = _between(run, np.asarray(times))
    return Frames(np.asarray(times), table("x"), table("y"), s, table("speed"), turn, between)


def _between(run: Moving, times: Array) -> Between:
    """Return states before each frame as far back as a period, where frames are too far apart."""
    periods = small_periods(run.system)
    step, span = min(periods) / _PER_PERIOD, max(periods)
    added = [
        np.arange(now - step, max(before, now - span), -step)[::-1]
        for before, now in pairwise(times.tolist())
        if now - before > step
    ]
    instants = np.concatenate([np.empty(0), *added])
    shape = len(instants), len(run.system.bodies)
    if not len(instants):
        return Between(instants, np.empty(shape), np.empty(shape), span)
    sampled = run.sample(instants)
    s, speed = (np.asarray(sampled[name], dtype=np.float64) for name in ("s", "speed"))
    return Between(instants, s.reshape(shape), speed.reshape(shape), span)


def small_periods(system: System) -> list[float]:
    """Return the periods (s) of small oscillations on the arcs, shorter where the trace turns.

    Without an arc or gravity that of a pendulum as long as the trace, or 1 s.
    """
    turning = 0.0 if system.turning is None else system.turning.square
    rates = [
        math.sqrt(turning + system.gravity / (body.kappa * piece.path_radius(body.radius)))
        for piece in system.trace.pieces
        for body in system.bodies
        if not piece.is_line
    ] or [math.sqrt(turning + system.gravity / system.trace.length)]
    return [2.0 * math.pi / rate if rate > 0.0 else 1.0 for rate in rates]


def _turned(trace: Trace, body: Body, arc: Any, s: Array) -> Array:
    """Return how far a body has turned (rad): the way of its centre through its radius."""
    if body.kind == PARTICLE:
        return np.zeros(len(s))
    scales = np.array(
        [1.0 if p.is_line else p.path_radius(body.radius) / p.radius for p in trace.pieces]
    )
    lengths = scales * [piece.length for piece in trace.pieces]
    before = np.concatenate([[0.0], np.cumsum(lengths)])
    starts = np.array([piece.start_s for piece in trace.pieces])
    way = before[arc] + scales[arc] * (s - starts[arc])
    if trace.closed:
        way = np.unwrap(way, period=before[-1])
    turned: Array = (way - way[0]) / body.radius
    return turned


@dataclass(frozen=True)
class Trail:
    """What a point in the phase plane runs through: states at frames, and jumps where they are."""

    time: Array
    """Times (s), not falling; shape (points,)."""
    s: Array
    """Arc length (m); NaN where the trail breaks: at the seam of a closed trace, and before what it
    has not of the time between two frames."""
    speed: Array
    """Signed speed of the centre (m/s)."""


def trail(run: Recorded, shown: Frames, body: int) -> Trail:
    """Return the trail of a body (from 0) through all frames; its impacts are vertical jumps.

    Where frames are further apart than a trail is long there is nothing between.
    """
    more = shown.between
    jumps = [*_struck(run, body), *_at_walls(run, body)]
    # at one time: before the impact, after it, the frame
    parts = [
        (shown.time, shown.s[:, body], shown.speed[:, body], 2),
        (more.time, more.s[:, body], more.speed[:, body], 2),
        *(_within(shown, jump) for jump in jumps),
    ]
    times, places, speeds = (np.concatenate([part[n] for part in parts]) for n in range(3))
    rank = np.concatenate([np.full(len(part[0]), part[3]) for part in parts])
    order = np.lexsort((rank, times))
    times, places, speeds = times[order], places[order], speeds[order]
    leaps = np.abs(np.diff(places)) > 0.5 * run.system.trace.length
    seams = np.flatnonzero(leaps | _after_gaps(shown, times)) + 1
    return Trail(
        np.insert(times, seams, times[seams]),
        np.insert(places, seams, math.nan),
        np.insert(speeds, seams, math.nan),
    )


_States = tuple[Array, Array, Array, int]
"""Times (s), arc lengths (m), speeds (m/s), and 0 before an impact, 1 after it."""


def _struck(run: Recorded, body: int) -> Iterator[_States]:
    """Yield the states of a body before and after its impacts on others."""
    table = run.collisions
    made = np.asarray(table["admissible"], dtype=np.bool_) | np.asarray(
        table["substituted"], dtype=np.bool_
    )
    for side in "ab":
        rows = np.flatnonzero((np.asarray(table[f"ball_{side}"]) == body + 1) & made)
        for order, when in enumerate(("pre", "post")):
            names = ("t", f"s_{side}", f"speed_{side}_{when}")
            time, s, speed = (np.asarray(table[name], dtype=np.float64)[rows] for name in names)
            yield time, s, speed, order


def _at_walls(run: Recorded, body: int) -> Iterator[_States]:
    """Yield the states of a body before and after its impacts on walls."""
    flights, pieces = run.flights(), run.system.trace.pieces
    scales = np.array(
        [1.0 if p.is_line else p.path_radius(run.system.bodies[body].radius) for p in pieces]
    )
    mine = np.asarray(flights["ball"]) == body + 1
    for order, end in enumerate(("end", "start")):
        rows = np.flatnonzero(mine & (np.asarray(flights[f"cause_{end}"], dtype=object) == "wall"))
        arc = np.asarray(flights["arc"])[rows] - 1
        places = flights[f"angle_{end}"][rows]
        along = [pieces[n].arc_length(place) for n, place in zip(arc, places, strict=True)]
        speed = scales[arc] * flights[f"rate_{end}"][rows]
        yield np.asarray(flights[f"t_{end}"])[rows], np.array(along, dtype=np.float64), speed, order


def _within(shown: Frames, jump: _States) -> _States:
    """Return those states that are not before all frames, after them or in a gap of the trail."""
    time, s, speed, order = jump
    following = np.searchsorted(shown.time, time, side="left")
    ahead = shown.time[np.minimum(following, len(shown.time) - 1)] - time
    here = (time >= shown.time[0]) & (time <= shown.time[-1]) & (ahead <= shown.between.span)
    return time[here], s[here], speed[here], order


def _after_gaps(shown: Frames, times: Array) -> NDArray[np.bool_]:
    """Return between which of the times of a trail there is time that it leaves out."""
    before = shown.time[:-1][np.diff(shown.time) > shown.between.span]
    gaps = np.zeros(len(times) - 1, dtype=np.bool_)
    gaps[np.searchsorted(times, before, side="right") - 1] = True
    return gaps


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
        draw_ends(self.plan, self.run.system, 0.06 * half[0])
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


FORMS = ("gif", "mp4")
_DPI = {"mp4": 200.0, "gif": 100.0}
_COLOURS = 64
# One thread and nothing of time or machine in the file: equal input gives equal bytes.
_ENCODING = [
    *("-an", "-c:v", "libx264", "-preset", "medium", "-crf", "18", "-pix_fmt", "yuv420p"),
    *("-threads", "1", "-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact"),
    *("-movflags", "+faststart", "-f", "mp4"),
]


class NoFilm(VibroError):
    """A film cannot be made; the message says why and what else there is."""


def movie(run: Recorded, frames: Frames, rate: int, form: str) -> bytes:
    """Return a film of a run as the bytes of a file; `form` is `gif` or `mp4`.

    `rate` is the number of frames in a second. Raises `NoFilm` where ffmpeg is not there, or fails.
    """
    if form == "mp4" and shutil.which("ffmpeg") is None:
        raise NoFilm(
            "a film as .mp4 needs the program ffmpeg, which is not there; .gif and .html do not"
        )
    film = Film(run, frames, _DPI[form])
    return _gif(film, rate) if form == "gif" else _mp4(film, rate)


def _gif(film: Film, rate: int) -> bytes:
    from PIL import Image

    first = Image.fromarray(film.picture(0)).quantize(_COLOURS)
    rest = (
        Image.fromarray(film.picture(frame)).quantize(palette=first, dither=Image.Dither.NONE)
        for frame in range(1, len(film.frames.time))
    )
    content = BytesIO()
    first.save(
        content,
        format="GIF",
        save_all=True,
        append_images=rest,
        duration=round(1000 / rate),
        loop=0,
    )
    return content.getvalue()


def _mp4(film: Film, rate: int) -> bytes:
    first = film.picture(0)
    size = f"{first.shape[1]}x{first.shape[0]}"
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", str(rate), "-i", "-"]
    with tempfile.TemporaryDirectory() as folder:
        target, words = Path(folder) / "film.mp4", Path(folder) / "words"
        command = ["ffmpeg", "-nostdin", "-v", "error", "-y", *raw, *_ENCODING, str(target)]
        with (
            words.open("wb") as said,
            subprocess.Popen(command, stdin=subprocess.PIPE, stderr=said) as encoder,
        ):
            assert encoder.stdin is not None
            try:
                for frame in range(len(film.frames.time)):
                    encoder.stdin.write(film.picture(frame).tobytes())
            except BrokenPipeError:
                pass  # ffmpeg gave up; its own words say why
            finally:
                encoder.stdin.close()
        if encoder.returncode:
            said_last = words.read_text(errors="replace").strip().rpartition("\n")[2]
            raise NoFilm(f"ffmpeg could not write the film: {said_last or encoder.returncode}")
        return target.read_bytes()
