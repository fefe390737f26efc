"""The tangent map of a motion by differences of the twin: neighbouring motions in 50 digits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vibro_cli.stress.highprecision.scene import Scene
from vibro_cli.stress.highprecision.taylor import mp
from vibro_cli.stress.highprecision.twin import Happening, Impact, Twin

# Small enough for an error of the second order to be none, large against rounding in 50 digits.
CHANGE = mp.mpf(10) ** -18


def ways_per_place(twin: Twin, ball: int, piece: int) -> mp.mpf:
    """Way (m) of the centre of a body for a unit of its place on a piece."""
    return twin.path_radius(ball, piece) if twin.scene.pieces[piece].sign else mp.one


def neighbour(scene: Scene, component: int, change: mp.mpf) -> Scene:
    """A scene with the way (m) or the speed (m/s) of one body changed at its start."""
    ball, part = divmod(component, 2)
    starts = list(scene.starts)
    piece, place, speed = starts[ball]
    if part == 0:
        place += change / ways_per_place(Twin(scene), ball, piece)
    else:
        speed += change
    starts[ball] = (piece, place, speed)
    return replace(scene, starts=tuple(starts))


def differences(
    scene: Scene, happenings: Sequence[Happening], end: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the derivative of the state at an instant (s), and of the times of all impacts.

    Parameters
    ----------
    scene
        What is run.
    happenings
        Its events, which are those of its neighbours too.
    end
        Instant (s) after all of them.

    Returns
    -------
    Derivatives to ways and speeds of all bodies at the start, ``[2 body + 0 or 1, component]`` of
    ways and speeds (m, m/s) and ``[impact, component]`` of times (s).
    """
    columns, times = [], []
    for component in range(2 * len(scene.bodies)):
        ahead = _motion(neighbour(scene, component, CHANGE), happenings, end)
        back = _motion(neighbour(scene, component, -CHANGE), happenings, end)
        columns.append([(b - a) / (2 * CHANGE) for a, b in zip(back[0], ahead[0], strict=True)])
        times.append([
            (b.t - a.t) / (2 * CHANGE) for a, b in zip(back[1], ahead[1], strict=True)
        ])  # fmt: skip
    return np.array(columns, dtype=float).T, np.array(times, dtype=float).T


def _motion(
    scene: Scene, happenings: Sequence[Happening], end: float
) -> tuple[list[mp.mpf], list[Impact]]:
    """Way and speed of every body at an instant, and the impacts before it."""
    twin = Twin(scene)
    impacts = twin.follow(happenings)
    found = []
    for ball in range(len(scene.bodies)):
        now = twin.at(ball, mp.mpf(end))
        found += [now.place * ways_per_place(twin, ball, now.piece), now.speed]
    return found, impacts
