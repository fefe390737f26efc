"""What the records of a run hold of a turning trace: potential, crests and bounds on each piece."""

from __future__ import annotations

import math

from vibro_cli.kernels.structs import TrackData
from vibro_cli.kernels.world import World
from vibro_cli.mechanics.potential import Pull, Turning, inside, roots
from vibro_cli.mechanics.system import System
from vibro_cli.mechanics.trace import Piece

# Bounds are kept above the rounding of what they bound.
CAUTION = 1.0 + 1.0e-12


def set_turning(world: World, system: System, turning: Turning) -> None:
    """Complete the records of a system on a trace that turns."""
    settings = world.settings[0]
    settings.axis_x = turning.x
    settings.turning_square = turning.square
    for number in range(settings.bodies):
        tracks = world.tracks[number * settings.pieces : (number + 1) * settings.pieces]
        lowest = math.inf
        for piece, track in zip(system.trace.pieces, tracks, strict=True):
            if piece.is_line:
                low = _set_line(system, turning, number, piece, track)
            else:
                low = _set_arc(system, turning, number, piece, track)
            lowest = min(lowest, low)
        for track in tracks:
            track.bottom -= lowest


def _set_line(
    system: System, turning: Turning, number: int, piece: Piece, track: TrackData
) -> float:
    """A line; returns the least potential height (m) on it, from the lowest place at rest."""
    kappa = system.bodies[number].kappa
    tangent = math.cos(piece.start_slope)
    away = track.line_x - turning.x
    track.line_growth = abs(turning.rate * tangent) / math.sqrt(kappa)
    track.line_acceleration += turning.square / kappa * away * tangent
    outwards = turning.square / system.gravity * math.sin(piece.start_slope)
    track.line_press = tangent + outwards * away
    track.line_press_growth = outwards * tangent
    track.bottom -= 0.5 * turning.square / system.gravity * away * away
    square = track.line_growth * track.line_growth
    ends = (track.left_s, track.right_s)
    track.gravity_rate = max(abs(track.line_acceleration + square * s) for s in ends)
    # The potential is concave along a line: its least value is at an end.
    factor = kappa / system.gravity
    heights = [-factor * (track.line_acceleration + 0.5 * square * s) * s for s in ends]
    return track.bottom + min(heights)


def _set_arc(
    system: System, turning: Turning, number: int, piece: Piece, track: TrackData
) -> float:
    """An arc; returns the least potential height (m) on it, from the lowest place at rest."""
    pull = Pull.on_arc(piece, system.bodies[number].radius, turning, system.gravity)
    track.tilt, track.spread = pull.tilt, pull.spread
    away = piece.center[0] - turning.x
    track.bottom -= 0.5 * turning.square / system.gravity * away * away
    low = 2.0 * math.atan2(track.left_s, track.left_c)
    high = 2.0 * math.atan2(track.right_s, track.right_c)
    if high < low:
        low -= 2.0 * math.tau
    equilibria = pull.equilibria()
    here = inside(equilibria, low, high)
    values = [pull.potential(angle) for angle in [low, high, *here]]
    track.lowest_potential = min(values)
    track.highest_potential = max(pull.potential(angle) for angle in equilibria)
    w2 = track.frequency * track.frequency
    track.most_angular = CAUTION * w2 * pull.greatest(0, low, high)
    track.most_stiffness = CAUTION * w2 * pull.greatest(1, low, high)
    track.most_bending = CAUTION * w2 * pull.greatest(2, low, high)
    track.steepest = CAUTION * w2 * pull.steepest_fall(low, high)
    track.gravity_rate = track.path_radius * track.most_angular
    crests = [angle for angle in here if pull.stiffness(angle) >= 0.0]
    track.crests = len(crests)
    halves = [(math.sin(0.5 * angle), math.cos(0.5 * angle)) for angle in crests]
    if halves:
        track.crest_s, track.crest_c = halves[0]
    if len(halves) > 1:
        track.other_crest_s, track.other_crest_c = halves[1]
    places = inside(force_extremes(pull, system.bodies[number].kappa), low, high)
    track.extreme_count = len(places)
    for index, angle in enumerate(places):
        track.extremes[2 * index] = math.sin(0.5 * angle)
        track.extremes[2 * index + 1] = math.cos(0.5 * angle)
    still = inside(roots(1.0, pull.tilt, 2.0 * pull.spread, 0), low, high)
    track.least_still = min(_press(piece.sign, pull, angle) for angle in [low, high, *still])
    share = 4.0 / system.bodies[number].kappa
    track.least_press = min(
        _press(piece.sign, pull, angle) - piece.sign * share * pull.potential(angle)
        for angle in [low, high, *places]
    )
    return track.bottom + track.twice_radius * track.lowest_potential


def _press(sign: float, pull: Pull, angle: float) -> float:
    """``N/(m g)`` of a body at rest at an angle f (rad)."""
    sine = math.sin(angle)
    return sign * (math.cos(angle) + sine * (pull.tilt + pull.spread * sine))


def force_extremes(pull: Pull, kappa: float) -> list[float]:
    """Angles f (rad) at which the normal force of the trace is stationary, whatever the energy.

    ``N/(m g) = sign (cos f + tilt sin f + spread sin^2 f + (4/kappa) P^2)``.
    """
    harmonic = 1.0 + 2.0 / kappa
    return roots(harmonic, harmonic * pull.tilt, 2.0 * (1.0 + 1.0 / kappa) * pull.spread, 0)
