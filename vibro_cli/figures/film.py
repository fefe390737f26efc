"""Films as files: GIF by Pillow, MP4 by the program ffmpeg.

A frame shows a plan with the moving bodies, and beside it a phase plane with a point for each
body. Each system defines what its films show: see ``System.film``.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from numpy.typing import NDArray

from vibro_cli.errors import VibroError
from vibro_cli.figures import style
from vibro_cli.figures.chart import body_look, distinct_lines, limits_around, number_plane
from vibro_cli.figures.source import Array
from vibro_cli.figures.style import panel_size
from vibro_cli.progress import WORK
from vibro_cli.systems.columns import made


@dataclass(frozen=True)
class Panel:
    """The phase plane beside the plan: speed against place."""

    symbol: str
    """Symbol of the place, in matplotlib's mathtext"""
    words: str
    """Description of the plane: "speed against ..." """
    lines: tuple[float, ...] = ()
    """Places at which the law of motion changes (m)"""


@dataclass(frozen=True)
class Link:
    """The link that holds a body: a polyline from a fixed foot to the centre of the body."""

    foot: tuple[float, float]
    """Place of the foot (m)"""
    coil: Array
    """Points, shape (points, 2): distance along, as a share of the length, and aside (m)"""

    def points(self, x: float, y: float) -> Array:
        """Return its points (m), shape (points, 2), for the centre of the body at (x, y)."""
        along = np.array([x, y]) - self.foot
        length = float(np.hypot(*along)) or 1.0
        side = np.array([-along[1], along[0]]) / length
        return self.foot + self.coil[:, :1] * along + self.coil[:, 1:] * side


@dataclass(frozen=True)
class Ground:
    """The fixed parts of a film."""

    radii: tuple[float, ...]
    """Radii of the bodies (m)"""
    low: Array
    """Lower left corner of the region that the plan must show (m)"""
    high: Array
    """Upper right corner (m)"""
    draw: Callable[[Axes, float], None]
    """Draws the fixed parts on the plan; its second argument is half the plan's width (m)"""
    words: str
    """Description of the plan: "the trace" """
    panel: Panel | None
    """The phase plane, None if the points move on the plan itself"""
    links: tuple[Link, ...] = ()
    """The links that hold the bodies, one for each body, or none"""


@dataclass(frozen=True)
class Trail:
    """The path of a point in the plane: states at the frames, and jumps at impacts."""

    time: Array
    """Times (s), non-decreasing; shape (points,)."""
    across: Array
    """Place (m); NaN where the trail breaks: at the seam of a closed trace, and where frames are
    further apart than the trail is long."""
    up: Array
    """Speed of the centre (m/s), or the second coordinate (m)."""


@dataclass(frozen=True)
class Frames:
    """States at the times of the frames; arrays have shape (frames, bodies), except the times."""

    ground: Ground
    time: Array
    """Times (s), shape (frames,)."""
    x: Array
    """Horizontal place of the centre (m)."""
    y: Array
    """Height of the centre, or the other coordinate in a horizontal plane (m)."""
    turn: Array | None
    """Angle (rad) by which the body has turned since the first frame, clockwise; None if it does
    not turn in the plane shown."""
    across: Array
    """First coordinate of the body's point in the plane: place (m)."""
    up: Array
    """Second coordinate: signed speed of the centre (m/s), or place (m)."""
    trails: tuple[Trail, ...]
    """Trails of all bodies."""
    span: float
    """Length of a trail in time (s); longer trails would cover one another."""


States = tuple[Array, Array, Array, int]
"""Times (s), places (m), speeds (m/s), and 0 before an impact, 1 after it, 2 at other times."""


def struck(run: Any, body: int, place: str) -> Iterator[States]:
    """Yield the states of a body (from 0) before and after its impacts on other bodies.

    `place` is the name of the column of its place (m), without the suffix `_a` or `_b`.
    """
    table = run.collisions
    for side in "ab":
        rows = np.flatnonzero((np.asarray(table[f"ball_{side}"]) == body + 1) & made(table))
        for order, when in enumerate(("pre", "post")):
            names = ("t", f"{place}_{side}", f"speed_{side}_{when}")
            time, s, speed = (np.asarray(table[name], dtype=np.float64)[rows] for name in names)
            yield time, s, speed, order


def frame_times(start: float, end: float, pace: float, rate: int) -> Array:
    """Return the times (s) of frames from `start` to `end`.

    `pace` is the time of the motion (s) per second of film, `rate` the frames per second of film.

    Raises ``ValueError`` for more than `MOST_FRAMES` frames.
    """
    step = pace / rate
    number = math.floor((end - start) / step * (1.0 + 1e-12)) + 1
    if number > MOST_FRAMES:
        raise ValueError(
            f"a film of {number} frames, expected at most {MOST_FRAMES}; "
            "a shorter span, a greater pace or fewer frames a second have fewer"
        )
    times: Array = np.minimum(start + step * np.arange(number), end)
    return times


def clock_digits(times: Array) -> int:
    """Return the decimals of the clock (s): three, or as many as distinguish the frames."""
    if len(times) < 2:
        return 3
    return max(3, -math.floor(math.log10(times[1] - times[0])))


def times_between(times: Array, step: float, span: float) -> Array:
    """Return the extra times (s) at which trails are sampled between the frames.

    Between frames more than `step` apart, they lie `step` apart and up to `span` before a frame.
    """
    added = [
        np.arange(now - step, max(before, now - span), -step)[::-1]
        for before, now in pairwise(times.tolist())
        if now - before > step
    ]
    return np.concatenate([np.empty(0), *added])


def trail(times: Array, span: float, parts: Iterable[States], seam: float = math.inf) -> Trail:
    """Return the trail through states, in order of their times; impacts are vertical jumps.

    The trail breaks between frames (`times`, s) that are more than `span` (s) apart, and at steps
    of more than `seam` (m), which cross the seam of a closed trace.
    """
    shown = [_within(times, span, part) for part in parts]
    time, across, up = (np.concatenate([part[n] for part in shown]) for n in range(3))
    # at one time: before the impact, after it, the frame
    order = np.lexsort((np.concatenate([np.full(len(one[0]), one[3]) for one in shown]), time))
    time, across, up = time[order], across[order], up[order]
    breaks = np.abs(np.diff(across)) > seam
    before = times[:-1][np.diff(times) > span]
    breaks[np.searchsorted(time, before, side="right") - 1] = True
    at = np.flatnonzero(breaks) + 1
    return Trail(
        np.insert(time, at, time[at]),
        np.insert(across, at, math.nan),
        np.insert(up, at, math.nan),
    )


def _within(times: Array, span: float, states: States) -> States:
    """Return the states between the first and the last frame that are not in a gap of the trail."""
    time, across, up, order = states
    following = np.searchsorted(times, time, side="left")
    ahead = times[np.minimum(following, len(times) - 1)] - time
    here = (time >= times[0]) & (time <= times[-1]) & (ahead <= span)
    return time[here], across[here], up[here], order


def trails_of(
    run: Any,
    times: Array,
    place: str,
    periods: Sequence[float],
    more: Callable[[Any, int], Iterable[States]] = lambda run, body: (),
    seam: float = math.inf,
) -> tuple[Array, Array, tuple[Trail, ...], float]:
    """Return places (m) and speeds (m/s) at frames (`times`, s), trails, and their length (s).

    The centres move along a line or trace. `place` is the column of their places, `periods` (s)
    are those of small oscillations, `more` gives further states of a body (from 0), and `seam` is
    as for :func:`trail`.
    """
    span = max(periods)
    between = times_between(times, min(periods) / _PER_PERIOD, span)
    at_frames, added = sampled(run, times, place), sampled(run, between, place)
    trails = []
    for body in range(len(run.system.bodies)):
        states = [
            (instants, x[:, body], v[:, body], 2)
            for instants, (x, v) in ((times, at_frames), (between, added))
        ]
        parts = [*states, *struck(run, body, place), *more(run, body)]
        trails.append(trail(times, span, parts, seam))
    return *at_frames, tuple(trails), span


def sampled(run: Any, times: Array, place: str) -> tuple[Array, Array]:
    """Return places (m), from the column `place`, and speeds (m/s); shape (times, bodies)."""
    shape = len(times), len(run.system.bodies)
    if not len(times):
        return np.empty(shape), np.empty(shape)
    motion = run.sample(times)
    found = (np.asarray(motion[name], dtype=np.float64) for name in (place, "speed"))
    across, up = (values.reshape(shape) for values in found)
    return across, up


_PER_PERIOD = 64
"""Points of a trail per shortest period."""
SIZE = (6.4, 3.6)
"""Width and height (inches)."""
TRAIL = 50
"""Length of a trail in the phase plane, in frames."""
_WIDE = 1.7
"""Ratio of width to height of a plan above which the plane is placed below it, not beside it."""
_LEAST = 0.008
"""Least radius with which a body is drawn, as a share of the width of the plan, ..."""
_MOST_LARGER = 100
"""... if there are at most this many bodies: more enlarged bodies would overlap."""
LARGER = 1.6
"""Magnification of letters relative to print, so that films can be watched on a phone."""


class FilmFrame:
    """The figure with the plan and the plane, on which the frames are drawn one after another."""

    def __init__(self, frames: Frames, dpi: float) -> None:
        self.frames, self.ground = frames, frames.ground
        with style.journal(LARGER):
            self.figure = Figure(figsize=SIZE, dpi=dpi)
            self.canvas: Any = FigureCanvasAgg(self.figure)  # its methods have no types
            self.plan, self.plane = self._axes(self.ground.panel)
            self._draw_plan()
            if self.ground.panel is not None:
                self._draw_plane(self.ground.panel)

    def _axes(self, panel: Panel | None) -> tuple[Axes, Axes]:
        """Return the axes of the plan and those in which the points move."""
        if panel is None:
            plan = self.figure.add_axes((0.02, 0.02, 0.96, 0.9))
            return plan, plan
        extent = self.ground.high - self.ground.low
        if extent[0] > _WIDE * extent[1]:
            boxes = ((0.02, 0.52, 0.96, 0.42), (0.12, 0.19, 0.86, 0.28))
        else:
            boxes = ((0.01, 0.02, 0.48, 0.9), (0.63, 0.18, 0.35, 0.74))
        plan, plane = (self.figure.add_axes(box) for box in boxes)
        return plan, plane

    def _draw_plan(self) -> None:
        """Draw the fixed parts to scale in the middle of their panel."""
        low, high = self.ground.low, self.ground.high
        box = self.plan.get_position()
        size = np.array([box.width * SIZE[0], box.height * SIZE[1]])
        half = 0.5 * size * float(np.max((high - low) / size))
        middle = 0.5 * (low + high)
        self.plan.set_xlim(middle[0] - half[0], middle[0] + half[0])
        self.plan.set_ylim(middle[1] - half[1], middle[1] + half[1])
        self.plan.set_axis_off()
        self.ground.draw(self.plan, float(half[0]))
        radii = self.ground.radii
        least = _LEAST * 2.0 * half[0] if len(radii) <= _MOST_LARGER else 0.0
        self.drawn_radii = [max(one, least) for one in radii]

    def _draw_plane(self, panel: Panel) -> None:
        """Draw the axes of speed against place; they contain the motion between frames, too."""
        axes, frames = self.plane, self.frames
        across = [frames.across.ravel(), *(way.across for way in frames.trails)]
        up = [frames.up.ravel(), *(way.up for way in frames.trails)]
        axes.set_xlim(limits_around(np.concatenate(across)))
        axes.set_ylim(limits_around(np.concatenate(up)))
        number_plane(axes, (f"${panel.symbol}$", "m"), ("$v$", "m/s"), larger=LARGER)
        for place in distinct_lines(panel.lines, axes.get_xlim(), panel_size(axes)[0]):
            axes.axvline(place, color=style.LEVEL_GREY, linewidth=0.5, zorder=0.8)

    def place(self, axes: Axes) -> tuple[float, float, float, float]:
        """Return a, b, c, d of x' = a + b x, y' = c + d y, in pixels from the upper left corner."""
        box = axes.get_position()
        wide, high = (side * self.figure.dpi for side in SIZE)
        (left, right), (low, top) = axes.get_xlim(), axes.get_ylim()
        b = box.width * wide / (right - left)
        d = -box.height * high / (top - low)
        return box.x0 * wide - b * left, b, (1.0 - box.y1) * high - d * top, d


class Film(FilmFrame):
    """Renders the frames as pictures; the fixed parts are drawn only once."""

    def __init__(self, frames: Frames, dpi: float) -> None:
        super().__init__(frames, dpi)
        with style.journal():
            self.canvas.draw()
            self._still = self.canvas.copy_from_bbox(self.figure.bbox)
            self._moving = [self._body(n) for n in range(len(self.ground.radii))]
            size = LARGER * style.TEXT
            self._clock = self.figure.text(0.02, 0.95, "", fontsize=size, va="center")
        self._digits = clock_digits(frames.time)

    def _body(self, body: int) -> _Moving:
        colour, dashes = body_look(body + 1)["color"], body_look(body + 1)["linestyle"]
        look: dict[str, Any] = {"facecolor": colour, "edgecolor": style.BLACK, "linewidth": 0.6}
        disk = Circle((0.0, 0.0), self.drawn_radii[body], **look)
        self.plan.add_patch(disk)
        (spoke,) = self.plan.plot([], [], color="white", linewidth=1.0)
        (link,) = self.plan.plot([], [], color=colour, linewidth=0.8)
        (line,) = self.plane.plot([], [], color=colour, linewidth=0.8, linestyle=dashes)
        (point,) = self.plane.plot([], [], marker="o", markersize=4.0, color=colour)
        return _Moving(disk, spoke, link, line, point)

    def _past(self, frame: int, body: int) -> tuple[Array, Array]:
        """Return the part of a body's trail that a frame shows (m, m/s)."""
        way, times = self.frames.trails[body], self.frames.time
        begins = max(times[max(0, frame - TRAIL)], times[frame] - self.frames.span)
        first = int(np.searchsorted(way.time, begins))
        last = int(np.searchsorted(way.time, times[frame], side="right"))
        return way.across[first:last], way.up[first:last]

    def picture(self, frame: int) -> NDArray[np.uint8]:
        """Return a frame, shape (height, width, 3)."""
        if not frame % _REPORT_EVERY:
            WORK.report(f"frame {frame + 1:,} of {len(self.frames.time):,}")
        self.canvas.restore_region(self._still)
        self._clock.set_text(f"$t = {self.frames.time[frame]:.{self._digits}f}$ s")
        with style.journal():
            for body, moving in enumerate(self._moving):
                self._move(frame, body, moving)
            for moving in self._moving:
                for axes, artist in (
                    (self.plane, moving.line),
                    (self.plan, moving.link),
                    (self.plan, moving.disk),
                    (self.plan, moving.spoke),
                    (self.plane, moving.point),
                ):
                    axes.draw_artist(artist)
            self._clock.draw(self.canvas.get_renderer())
        return np.array(self.canvas.buffer_rgba())[:, :, :3]

    def _move(self, frame: int, body: int, moving: _Moving) -> None:
        """Move a body, its link, its point and its trail to their places in a frame."""
        states = self.frames
        x, y = states.x[frame, body], states.y[frame, body]
        moving.disk.set_center((x, y))
        if states.turn is not None:
            turned, reach = states.turn[frame, body], 0.85 * self.drawn_radii[body]
            ends = [x, x + reach * math.sin(turned)], [y, y + reach * math.cos(turned)]
            moving.spoke.set_data(*ends)
        if self.ground.links:
            moving.link.set_data(*self.ground.links[body].points(x, y).T)
        moving.line.set_data(*self._past(frame, body))
        if self.plane is not self.plan:
            moving.point.set_data([states.across[frame, body]], [states.up[frame, body]])


class _Moving(NamedTuple):
    """The moving artists of a body."""

    disk: Circle
    spoke: Line2D
    link: Line2D
    line: Line2D
    point: Line2D


FORMS = ("gif", "mp4")
MOST_FRAMES = 20000
SECONDS = 30.0
"""Default length of a film (s)."""
_DPI = {"mp4": 200.0, "gif": 100.0}
_COLOURS = 63
"""Number of colours of a GIF, besides the transparent one."""
_REPORT_EVERY = 25
# One thread, and no time or machine in the metadata, so that equal input gives equal bytes.
_ENCODING = [
    *("-an", "-c:v", "libx264", "-preset", "medium", "-crf", "18", "-pix_fmt", "yuv420p"),
    *("-threads", "1", "-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact"),
    *("-movflags", "+faststart", "-f", "mp4"),
]


class NoFilm(VibroError):
    """Raised if a film cannot be made; the message says why and names alternatives."""


def check_encoder(form: str) -> None:
    """Raise `NoFilm` if a format needs ffmpeg (`mp4` does) and it is not installed."""
    if form == "mp4" and shutil.which("ffmpeg") is None:
        raise NoFilm(
            "a film as .mp4 needs the program ffmpeg, which is not there; .gif and .html do not"
        )


def movie(frames: Frames, rate: int, form: str) -> bytes:
    """Return a film as the bytes of a file; `form` is `gif` or `mp4`.

    `rate` is the number of frames per second. Raises `NoFilm` if ffmpeg is missing or fails.
    """
    check_encoder(form)
    film = Film(frames, _DPI[form])
    return _gif(film, rate) if form == "gif" else _mp4(film, rate)


def _gif(film: Film, rate: int) -> bytes:
    """Return a GIF, encoded frame by frame: Pillow's own writer would keep all frames in memory."""
    from PIL import Image
    from PIL.GifImagePlugin import getdata, getheader

    first = Image.fromarray(film.picture(0)).quantize(_COLOURS)
    # Pixels that do not change are transparent; that colour's index follows the last colour.
    look: dict[str, Any] = {"duration": round(1000 / rate), "transparency": _COLOURS}
    parts = [*getheader(first.copy(), info={"loop": 0})[0], *getdata(first, **look)]
    before = np.asarray(first)
    for frame in range(1, len(film.frames.time)):
        shown = Image.fromarray(film.picture(frame))
        now = np.asarray(shown.quantize(palette=first, dither=Image.Dither.NONE))
        box = Image.fromarray(now != before).getbbox() or (0, 0, 1, 1)  # one pixel if none changes
        left, upper, right, lower = box
        changes = np.where(now == before, np.uint8(_COLOURS), now)[upper:lower, left:right]
        parts += getdata(Image.fromarray(changes), (left, upper), **look)
        before = now
    return b"".join([*parts, b";"])


def _mp4(film: Film, rate: int) -> bytes:
    first = film.picture(0)
    size = f"{first.shape[1]}x{first.shape[0]}"
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", str(rate), "-i", "-"]
    with tempfile.TemporaryDirectory() as folder:
        target, words = Path(folder) / "film.mp4", Path(folder) / "words"
        command = ["ffmpeg", "-nostdin", "-v", "error", "-y", *raw, *_ENCODING, str(target)]
        with (
            suppress(BrokenPipeError),  # ffmpeg has exited; its own message is reported below
            words.open("wb") as said,
            subprocess.Popen(command, stdin=subprocess.PIPE, stderr=said) as encoder,
        ):
            assert encoder.stdin is not None
            for frame in range(len(film.frames.time)):
                encoder.stdin.write(film.picture(frame).tobytes())
        if encoder.returncode:
            said_last = words.read_text(errors="replace").strip().rpartition("\n")[2]
            raise NoFilm(f"ffmpeg could not write the film: {said_last or encoder.returncode}")
        return target.read_bytes()
