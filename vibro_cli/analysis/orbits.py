"""Periodic orbits by Newton's method with the exact tangent map, and their multipliers.

An orbit is a start z (ways along the paths of the centres and speeds, m and m/s) and a period T
with ``Phi_T(z) = z``. Each step solves ``(M - 1) dz + f dT = z - Phi_T(z)`` with the tangent map M
and the velocity f of the state, together with what belongs to a family and does not change, in the
sense of least squares: the shift along the orbit (``f dz = 0``), and the energy where it is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibro_cli.assemble import with_start_of
from vibro_cli.errors import VibroError
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics import initial_conditions
from vibro_cli.mechanics.system import LAWS, InitialState, TraceSystem, neighbours
from vibro_cli.numerics.elementwise import Floats
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system
from vibro_cli.systems.trace.tangents import matrix_of, time_scale

if TYPE_CHECKING:
    from vibro_cli.scenario.models import Scenario

# An orbit has been found when it closes up to this share of the size of its state.
CLOSED = 1.0e-13
# Rounding of a long or unstable orbit leaves more; beyond this it is none.
NEARLY_CLOSED = 1.0e-10
# Multipliers that coincide, at 1 or -1, part by the root of the error of the map, which is up to
# about 1e-8 for an orbit that is nearly closed.
PARTED = 1.0e-4
# Others have an error of the size of the map's.
ROUNDING = 1.0e-6
MOST_STEPS = 40
# A motion that has so many in a period is followed no further.
MOST_IMPACTS = 10_000
_LOSSY = "impacts take energy: found a coefficient of restitution of {:g}, expected 1"
# A period below this share of the first guess is none: in no time every motion closes.
LEAST_PERIOD = 1.0e-6
# Shares of Newton's step that are tried in turn, and penalties of long steps, as shares of the
# largest singular value.
SHARES = tuple(2.0**-power for power in range(13))
PENALTIES = tuple(10.0**power for power in range(-8, 1))
# Singular values below this share of the largest one are of directions in which how a motion closes
# hardly changes. Motions that nearly close are a curve along them, which a straight step leaves by
# its square; a second step, of the others alone, leads back to it.
STIFF = 1.0e-3


class NoOrbit(VibroError):
    """There is no orbit as it was asked for; the message says why."""


@dataclass(frozen=True)
class Shot:
    """A motion from a start over a period."""

    end: Floats
    """Ways and speeds at its end"""
    matrix: Floats
    """The tangent map"""
    word: tuple[str, ...]
    """What happened, see :func:`events_of`"""
    times: tuple[float, ...]
    """When, s"""
    jumps: tuple[tuple[str, ...], ...]
    """Of each body the events that a family keeps, in their order: the motion changes smoothly
    where two that share no body come to one instant, and where one crosses a junction; but on a
    closed trace it may be the seam"""
    instants: tuple[float, ...]
    """When, of all bodies, s"""
    approach: float
    """Least normal speed of its impacts and at walls, m/s; infinite without any"""


@dataclass(frozen=True)
class Orbit:
    """A periodic orbit."""

    system: TraceSystem
    """With its start"""
    period: float
    """s"""
    state: Floats
    """Ways and speeds at its start"""
    shot: Shot
    residual: float
    """Distance of its end from its start, as a share of the size of the state"""
    energy: float
    """That impacts keep, see `energy_of`: J, from the level of the trace's left end"""

    @property
    def reduced(self) -> Floats:
        """The tangent map across the orbit, on its level of energy."""
        flow = velocity(self.system, self.state)
        gradient = energy_gradient(self.system, self.state)
        scale = scale_of(self.system)
        normals = np.array([flow * scale, gradient / scale])
        basis = np.linalg.svd(normals)[2][2:].T
        matrix: Floats = basis.T @ ((self.shot.matrix * scale[:, None] / scale) @ basis)
        return matrix

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """Of the map across the orbit on its level of energy, the largest first."""
        values = np.linalg.eigvals(self.reduced).astype(np.complex128)
        return values[np.argsort(-np.abs(values), kind="stable")]

    @cached_property
    def part_gaps(self) -> dict[int, Floats]:
        """How far (m) the orbit is from having a half, a third, … of its period, by that number.

        From each middle between two jumps, as its start, to the same one so much later.
        """
        instants, jumps = self.shot.instants, self.shot.jumps
        repeated = [
            parts
            for parts in range(2, len(instants) + 1)
            if all(one[: len(one) // parts] * parts == one for one in jumps)
        ]
        if not repeated:
            return {}
        times = np.array([instants[-1] - self.period, *instants])
        run = simulate_system(self.system, self.period, None)
        states = state_at(run, np.maximum(0.5 * (times[1:] + times[:-1]), 0.0))
        found = {}
        for parts in repeated:
            later = len(states) // parts
            gaps = gap_of(self.system, states[:-later], states[later:])
            found[parts] = (gaps * scale_of(self.system)).ravel()
        return found

    @property
    def stable(self) -> bool:
        """Whether no small change grows as a power of a number."""
        return self.outside == 0

    @property
    def outside(self) -> int:
        """How many multipliers are out of the unit circle, of which the first so many are."""
        error = np.where(self._at_one, PARTED, ROUNDING)
        return int(np.sum(~(np.abs(self.multipliers) < 1.0 + error)))

    @property
    def verdict(self) -> str:
        """``stable``, ``unstable`` or ``neutral``.

        Neutral with multipliers at 1 or -1: a small change can grow as the number of periods.
        """
        if not self.stable:
            return "unstable"
        return "neutral" if np.any(self._at_one) else "stable"

    def as_start(self, scenario: Scenario) -> Scenario:
        """Return the scenario of which it is an orbit, begun on it."""
        return with_start_of(scenario, self.system)

    def __repr__(self) -> str:
        return f"<Orbit {' '.join(self.shot.word)}: period {self.period:.6g} s, {self.verdict}>"

    @property
    def _at_one(self) -> NDArray[np.bool_]:
        """Which multipliers are at 1 or -1."""
        apart = np.minimum(np.abs(self.multipliers - 1.0), np.abs(self.multipliers + 1.0))
        return apart < PARTED


def scale_of(system: TraceSystem) -> Floats:
    """What one unit of each number of a state is in metres."""
    return np.tile([1.0, float(time_scale(system))], len(system.bodies))


def _lengths(system: TraceSystem, body: int) -> list[float]:
    """Length (m) of the path of a body's centre on each piece."""
    pieces, radius = system.trace.pieces, system.bodies[body].radius
    return [one.path_scale(radius) * (one.angle_end - one.angle_start) for one in pieces]


def way_of(system: TraceSystem, body: int, piece: int, position: float) -> float:
    """Way (m) of a body's centre from the left end of its path."""
    on = system.trace.pieces[piece]
    along = on.path_scale(system.bodies[body].radius) * (position - on.angle_start)
    return sum(_lengths(system, body)[:piece]) + along


def place_of(system: TraceSystem, body: int, way: float) -> tuple[int, float]:
    """Piece and position on it of a way."""
    lengths = _lengths(system, body)
    if system.trace.closed:
        way %= sum(lengths)
    piece = 0
    while piece < len(lengths) - 1 and way > lengths[piece]:
        way -= lengths[piece]
        piece += 1
    on = system.trace.pieces[piece]
    if not 0.0 <= way <= lengths[piece]:
        raise NoOrbit(f"body {body + 1} would start off the trace")
    position = on.angle_start + way / on.path_scale(system.bodies[body].radius)
    return piece, min(position, on.angle_end)  # rounding may lead beyond


def state_of(system: TraceSystem) -> Floats:
    """Ways and speeds at the start of a system."""
    starts = enumerate(system.initial)
    return np.ravel([(way_of(system, n, one.piece, one.position), one.speed) for n, one in starts])


def started(system: TraceSystem, state: Floats) -> TraceSystem:
    """Return the system with another start, which may be none for a motion, see `admitted`."""
    pairs = enumerate(state.reshape(-1, 2).tolist())
    initial = tuple(InitialState(*place_of(system, n, way), speed) for n, (way, speed) in pairs)
    return replace(system, initial=initial)


def admitted(system: TraceSystem, state: Floats) -> TraceSystem:
    """Return the system with another start that a scenario might have.

    Raises
    ------
    NoOrbit
        If bodies would start off the trace, out of order (as when one has gone over the seam of a
        closed trace before another), in one another or in a wall.
    """
    found = started(system, state)
    trace, bodies, initial = found.trace, found.bodies, found.initial
    for a, b in neighbours(len(bodies), trace.closed):
        if b > a and initial_conditions.out_of_order(initial[a], initial[b]):
            raise NoOrbit(f"body {b + 1} would start left of body {a + 1}")
        gap, rounding = initial_conditions.gap(trace, bodies[a], initial[a], bodies[b], initial[b])
        if gap < -rounding:
            raise NoOrbit(f"bodies {min(a, b) + 1} and {max(a, b) + 1} would start overlapping")
    ends = ((system.left_end, 0, False), (system.right_end, len(bodies) - 1, True))
    for end, body, right in ends:
        piece, start = trace.pieces[-1 if right else 0], initial[body]
        if end is None or start.piece != piece.index:
            continue
        touch = initial_conditions.wall_position(piece, bodies[body].radius, right)
        if initial_conditions.reaches_into_wall(piece, start.position, touch, right):
            raise NoOrbit(f"body {body + 1} would start in a wall")
    return found


def velocity(system: TraceSystem, state: Floats) -> Floats:
    """Speeds (m/s) and accelerations (m/s^2) of a state without contact."""
    found = []
    for body, start in zip(system.bodies, started(system, state).initial, strict=True):
        piece = system.trace.pieces[start.piece]
        slope = piece.slope(start.position)
        pull = -system.gravity * np.sin(slope)
        if system.turning is not None:
            x, _ = piece.body_centre(start.position, body.radius)
            pull += system.turning.square * (x - system.turning.x) * np.cos(slope)
        found += [start.speed, pull / body.kappa]
    return np.array(found)


def _shares(system: TraceSystem) -> Floats:
    """What the energy of each body counts in the energy that impacts with k = 1 keep.

    The translational law keeps the sum of m v^2, where rolling has that of kappa m v^2. On its
    path each body keeps its own energy, so that all over their kappa are kept, here times the
    first body's: for equal kappa this is the energy.
    """
    kappa = np.array([body.kappa for body in system.bodies])
    return kappa[0] / kappa if LAWS[system.law].balances_mass else np.ones(len(kappa))


def energy_of(system: TraceSystem, state: Floats) -> float:
    """Energy (J) that impacts keep (see `_shares`), potential from the trace's left end on."""
    total, initial = 0.0, started(system, state).initial
    for body, start, share in zip(system.bodies, initial, _shares(system), strict=True):
        x, height = system.trace.pieces[start.piece].body_centre(start.position, body.radius)
        if system.turning is not None:
            height -= 0.5 * system.turning.square / system.gravity * (x - system.turning.x) ** 2
        kinetic = 0.5 * body.kappa * start.speed * start.speed
        total += float(share) * (body.mass * (system.gravity * height + kinetic))
    return total


def energy_gradient(system: TraceSystem, state: Floats) -> Floats:
    """Derivative of the energy that impacts keep to ways (J/m) and speeds (J s/m)."""
    flow = velocity(system, state)
    inertia = _shares(system) * [body.rolling_mass for body in system.bodies]
    return np.column_stack([-inertia * flow[1::2], inertia * state[1::2]]).ravel()


def events_of(run: Run) -> list[tuple[float, str, float]]:
    """Return time (s), name and normal speed (m/s) of what happens in a run, in order.

    ``12`` is an impact of bodies 1 and 2, ``1>`` and ``1<`` a crossing to the right or left (its
    speed is infinite), ``1|`` a wall.
    """
    events, rows = run.events, run.collisions
    found: list[tuple[float, str, float]] = []
    names = ("t", "event", "ball", "speed", "value")
    for t, name, ball, speed, value in zip(*(events[one] for one in names), strict=True):
        if name == "wall":
            found.append((float(t), f"{int(ball)}|", abs(float(value))))
        elif name == "crossing":
            found.append((float(t), f"{int(ball)}{'>' if speed > 0.0 else '<'}", np.inf))
    columns = (rows[name] for name in ("t", "ball_a", "ball_b", "approach_speed"))
    for t, one, other, approach in zip(*columns, strict=True):
        found.append((float(t), f"{int(one)}{int(other)}", float(approach)))
    return sorted(found)


def shoot(system: TraceSystem, period: float) -> Shot:
    """Follow a motion and its tangent map over a period (s).

    Raises
    ------
    NoOrbit
        If it ends sooner, meets lasting contact, or has impacts that together keep no energy.
    """
    if not period > 0.0:
        raise NoOrbit("the period has become zero")
    run = simulate_system(system, period, MOST_IMPACTS)
    if run.end_cause == "collisions":
        raise NoOrbit(f"found {MOST_IMPACTS} impacts in a period, expected fewer")
    if run.end_cause != "time":
        raise NoOrbit(f"the motion ends: {run.end_cause}")
    if np.ptp(_shares(system)) > 0.0 and np.any(run.collisions["law"] != system.law):
        raise NoOrbit("impacts by normal-impulse among translational ones keep no energy")
    matrix = matrix_of(run)
    if run.clock["contacts"] or not np.all(np.isfinite(matrix)):
        raise NoOrbit("bodies stay in contact")
    events = events_of(run)
    kept = [(t, word) for t, word, _ in events if system.trace.closed or word[-1] not in "<>"]
    return Shot(
        end=state_at(run, period),
        matrix=matrix,
        word=tuple(word for _, word, _ in events),
        times=tuple(t for t, _, _ in events),
        jumps=by_body([word for _, word in kept], len(system.bodies)),
        instants=tuple(t for t, _ in kept),
        approach=min((speed for _, _, speed in events), default=np.inf),
    )


def by_body(word: Sequence[str], bodies: int) -> tuple[tuple[str, ...], ...]:
    """Of each body what happens to it, in its order."""
    numbers = map(str, range(1, bodies + 1))
    return tuple(tuple(one for one in word if number in one) for number in numbers)


def state_at(run: Run, t: Any) -> Floats:
    """Ways and speeds of a run at an instant (s), or at each of several."""
    system, sample = run.system, run.sample(np.atleast_1d(t))
    start = np.array([piece.start_s for piece in system.trace.pieces])
    along = sample["s"] - start[sample["arc"] - 1]
    positions = np.where(np.isnan(sample["angle"]), along, sample["angle"])
    rows = zip(sample["ball"].tolist(), sample["arc"].tolist(), positions.tolist(), strict=True)
    ways = [way_of(system, ball - 1, arc - 1, position) for ball, arc, position in rows]
    return np.column_stack([ways, sample["speed"]]).reshape(*np.shape(t), -1)


def gone_through_once(orbit: Orbit) -> Orbit:
    """Return an orbit over its least period."""
    for times in range(len(orbit.shot.word), 1, -1):
        if any(one != one[: len(one) // times] * times for one in orbit.shot.jumps):
            continue
        once = over_period(orbit, orbit.period / times)
        if once.residual <= NEARLY_CLOSED:
            return once
    return orbit


def over_period(orbit: Orbit, period: float) -> Orbit:
    """Return an orbit gone through in another period (s), which it need not close in."""
    shot = shoot(orbit.system, period)
    residual = residual_of(orbit.system, shot, orbit.state, None)
    return replace(orbit, period=period, shot=shot, residual=residual)


def begun_between(orbit: Orbit, longest: bool = False) -> Orbit:
    """Return an orbit begun in the middle between two jumps: those around its start.

    So the start of an orbit of a family is one of its places, and no jump comes over it. One so
    unstable that rounding lets it close from its old start only is returned as it is.
    ``longest``: between the two events that are farthest apart of those where they are in order:
    from one that goes over the seam of a closed trace to the other one they are not.

    Raises
    ------
    NoOrbit
        If the motion from there has other events.
    """
    times, period = orbit.shot.instants, orbit.period
    middles = [0.5 * (times[0] + times[-1] - period)]
    if longest:
        times = orbit.shot.times
        gaps = np.diff([*times, times[0] + period])
        middles = [
            times[after] + 0.5 * float(gaps[after]) for after in np.argsort(-gaps, kind="stable")
        ]
    run = simulate_system(orbit.system, period, None)
    for middle in middles:
        if abs(middle) < CLOSED * period:
            break
        state = state_at(run, middle % period)
        try:
            system = admitted(orbit.system, state)
        except NoOrbit:
            continue
        moved = over_period(replace(orbit, system=system, state=state), period)
        if [*map(sorted, moved.shot.jumps)] != [*map(sorted, orbit.shot.jumps)]:
            raise NoOrbit("the events change")
        if moved.residual <= NEARLY_CLOSED:
            return moved
    return orbit


def gap_of(system: TraceSystem, start: Floats, end: Floats) -> Floats:
    """End of a motion less its start; whole rounds of a closed trace are none."""
    gap = end - start
    if system.trace.closed:
        rounds = np.array([sum(_lengths(system, body)) for body in range(len(system.bodies))])
        gap[..., ::2] -= rounds * np.round(gap[..., ::2] / rounds)
    return gap


def size_of(system: TraceSystem, state: Floats) -> float:
    """Size (m) of a state, against which a residual is held."""
    return float(np.linalg.norm(state * scale_of(system)))


def newton(system: TraceSystem, state: Floats, period: float, energy: float | None = None) -> Orbit:
    """Return the periodic orbit near a start.

    Parameters
    ----------
    system
        What moves; its start is not used.
    state, period
        A guess, whose events the orbit is to have.
    energy
        Of the orbit (J); without it that of the guess is kept as nearly as possible.

    Raises
    ------
    NoOrbit
        If it does not converge, or only to a motion with other events, or to one of no time.
    """
    shot = shoot(admitted(system, state), period)
    walls = [end.restitution for end in (system.left_end, system.right_end) if end is not None]
    if any(event.endswith("|") for event in shot.word) and all(k != 1.0 for k in walls):
        raise NoOrbit(_LOSSY.format(walls[0]))
    guess = _Guess(state, period, shot, residual_of(system, shot, state, energy))
    searches = (_shares_of_newton, False), (_steps_of_marquardt, False), (_steps_of_marquardt, True)
    for steps, bent in searches:
        found = _improved(system, guess, energy, steps, bent)
        if found.residual <= NEARLY_CLOSED:
            break
    else:
        raise NoOrbit(
            f"Newton's method does not converge: it comes to a motion that fails to close by "
            f"{found.residual:.2g} of the size of its state; begin nearer to one, or with another "
            "number of impacts or period"
        )
    if found.period < LEAST_PERIOD * period:
        raise NoOrbit("the period has become zero")
    start, own = started(system, found.state), energy_of(system, found.state)
    return Orbit(start, found.period, found.state, found.shot, found.residual, own)


class _Guess(NamedTuple):
    """A motion that may become an orbit, and how far it is from closing."""

    state: Floats
    period: float
    shot: Shot
    residual: float


Steps = Callable[[Floats, Floats], Iterator[tuple[Floats, float]]]
"""Steps to be tried in turn, each with the share of the residual of which it is to leave less."""


def _shares_of_newton(rows: Floats, right: Floats) -> Iterator[tuple[Floats, float]]:
    step = np.asarray(np.linalg.lstsq(rows, right, rcond=1e-12)[0], dtype=np.float64)
    yield from ((share * step, 1.0 - 0.1 * share) for share in SHARES)


def _steps_of_marquardt(rows: Floats, right: Floats) -> Iterator[tuple[Floats, float]]:
    """Newton's step, then ever shorter ones that turn to steepest descent.

    Around a stable orbit many motions nearly close: the rows nearly lose their rank, and Newton's
    step goes far along what hardly changes how they close, with all of its shares.
    """
    left, sizes, across = np.linalg.svd(rows, full_matrices=False)
    told = left.T @ right
    for penalty in (EPSILON, *PENALTIES):
        yield across.T @ (told * sizes / (sizes**2 + (penalty * sizes[0]) ** 2)), 0.95


def _improved(
    system: TraceSystem, guess: _Guess, energy: float | None, steps: Steps, bent: bool
) -> _Guess:
    """The motion to which steps lead that come nearer, each with the same events.

    ``bent``: of a step that comes no nearer the end is taken back across, see `STIFF`.
    """
    scale, tau = scale_of(system), float(time_scale(system))
    columns = np.append(1.0 / scale, 1.0 / (system.gravity * tau))  # m/s, by which a period counts
    for _ in range(MOST_STEPS):
        rows, right = equations(system, guess.shot, guess.state, energy)
        for step, most in steps(rows * columns, right):
            new = _stepped(system, guess, step * columns, energy)
            if bent and new is not None and new.residual >= most * guess.residual:
                rows, right = equations(system, new.shot, new.state, energy)
                back = np.linalg.lstsq(rows * columns, right, rcond=STIFF)[0]
                new = _stepped(system, new, back * columns, energy)
            if new is not None and new.residual < most * guess.residual:
                guess = new
                break
        else:
            break
        if guess.residual < CLOSED:
            break
    return guess


def _stepped(
    system: TraceSystem, guess: _Guess, step: Floats, energy: float | None
) -> _Guess | None:
    """The motion a step farther, None without the same events."""
    state, period = guess.state + step[:-1], guess.period + float(step[-1])
    try:
        shot = shoot(admitted(system, state), period)
    except NoOrbit:
        return None
    if shot.jumps != guess.shot.jumps:
        return None
    return _Guess(state, period, shot, residual_of(system, shot, state, energy))


def residual_of(system: TraceSystem, shot: Shot, state: Floats, energy: float | None) -> float:
    """How far a motion is from closing (and from the energy), as a share of its size."""
    closing, kept = np.split(equations(system, shot, state, energy)[1], [len(state)])
    return float(np.linalg.norm(closing) + np.sum(np.abs(kept))) / size_of(system, state)


def equations(
    system: TraceSystem, shot: Shot, state: Floats, energy: float | None
) -> tuple[Floats, Floats]:
    """Rows over the changes of state and period, in metres, and their right side."""
    scale = scale_of(system)
    start_flow = velocity(system, state)
    end_flow = velocity(system, np.where(np.isnan(shot.end), state, shot.end))
    closing = np.hstack([shot.matrix - np.eye(len(state)), end_flow[:, None]]) * scale[:, None]
    rows = [*closing, np.append(start_flow * scale**2 / np.linalg.norm(start_flow * scale), 0.0)]
    right = [*(-gap_of(system, state, shot.end) * scale), 0.0]
    if energy is not None:
        gradient = energy_gradient(system, state)
        size = float(np.linalg.norm(gradient / scale))
        rows.append(np.append(gradient / size, 0.0))
        right.append((energy - energy_of(system, state)) / size)
    return np.array(rows), np.array(right)


def nearest_return(system: TraceSystem, impacts: int | None, longest: float | None) -> float:
    """Time (s) at which a motion comes nearest to its start, after so many impacts.

    Of the first two dozen numbers of impacts, if none is given, the one with the nearest return.

    Raises
    ------
    NoOrbit
        If the motion has not as many impacts.
    """
    count = 24 if impacts is None else impacts
    run = simulate_system(system, longest, count + 1)
    times = run.collisions["t"]
    least = impacts or 1
    if len(times) <= least:
        told = (
            f"found {len(times)} until the run ended ({run.end_cause}), expected more than {least}"
        )
        raise NoOrbit(f"impacts: {told}")
    wanted = range(1, len(times)) if impacts is None else range(impacts, impacts + 1)
    state, scale, best = state_of(system), scale_of(system), (np.inf, 0.0)
    flow = velocity(system, state) * scale
    for number in wanted:
        instants = np.linspace(times[number - 1], times[number], 402)[1:-1]
        gaps = gap_of(system, state, state_at(run, instants)) * scale
        squares = np.sum(gaps**2, axis=1)
        nearest = int(np.argmin(squares))
        along, instant = float(flow @ gaps[nearest]), float(instants[nearest])
        if along**2 > 0.5 * squares[nearest] * (flow @ flow):  # a matter of time more than of place
            instant -= along / float(flow @ flow)
        best = min(best, (float(squares[nearest]), instant))
    return best[1]


def find_orbit(
    system: TraceSystem,
    impacts: int | None = None,
    period: float | None = None,
    longest: float | None = None,
) -> Orbit:
    """Return the periodic orbit next to the start of a system.

    Parameters
    ----------
    impacts, period
        Of the orbit, if known: a guess of the period is then taken from its return.
    longest
        How long (s) a return is waited for at most; None for as long as impacts follow.
    """
    if len(system.bodies) < 2:
        raise NoOrbit("found one body, expected two or more: an orbit of impacts")
    if all(k != 1.0 for k in system.restitution):
        raise NoOrbit(_LOSSY.format(system.restitution[0]))
    if period is None:
        period = nearest_return(system, impacts, longest)
    orbit = gone_through_once(newton(system, state_of(system), period))
    if not any(word.isdigit() for word in orbit.shot.word):
        raise NoOrbit("the orbit next to this start has no impact")
    # Bodies at rest come back too: within what an orbit may fail to close by they meet as well.
    slow = NEARLY_CLOSED * size_of(system, orbit.state) / float(time_scale(system))
    if orbit.shot.approach < slow:
        raise NoOrbit("the orbit next to this start has an impact or a bounce of no speed")
    return begun_between(orbit, longest=True)
