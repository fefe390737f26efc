"""Periodic orbits by Newton's method with the exact tangent map, and their multipliers.

An orbit is a start z (displacements along the paths of the centres and speeds, m and m/s) and a
period T with ``Phi_T(z) = z``. Each step solves ``(M - 1) dz + f dT = z - Phi_T(z)`` by least
squares, with the tangent map M and the velocity f of the state. Further equations fix the free
parameters of a family of solutions: the shift along the orbit (``f dz = 0``), and the energy if it
is prescribed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibro_cli.analysis.event_words import by_body, impact_word, is_impact
from vibro_cli.analysis.levels import Landscape
from vibro_cli.assemble import with_start_of
from vibro_cli.errors import VibroError
from vibro_cli.kernels.impact.laws import LAW_NAMES
from vibro_cli.kernels.numerics.constants import EPSILON
from vibro_cli.mechanics import initial_conditions
from vibro_cli.mechanics.system import LAWS, InitialState, TraceSystem, neighbours
from vibro_cli.numerics.elementwise import Floats
from vibro_cli.progress import WORK
from vibro_cli.systems.run import Run
from vibro_cli.systems.tangents import matrix_of
from vibro_cli.systems.trace import SYSTEM, simulate_system
from vibro_cli.systems.trace.events import boundaries

if TYPE_CHECKING:
    from vibro_cli.scenario.models import Scenario

# Residuals are relative to the size of the state. An orbit has converged at this residual.
CLOSED = 1.0e-13
# Rounding leaves more in a long or unstable orbit; a larger residual is rejected.
NEARLY_CLOSED = 1.0e-10
# Multipliers that coincide, at 1 or -1, are split by the square root of the map's error, which is
# up to about 1e-8 for an orbit that is nearly closed.
PARTED = 1.0e-4
# Other multipliers have an error of the order of the map's.
ROUNDING = 1.0e-6
MOST_STEPS = 40
# A motion is abandoned after this many impacts in a period.
MOST_IMPACTS = 10_000
_LOSSY = "{} lose energy: found a coefficient of restitution of {:g}, expected 1"
# Periods below this fraction of the first guess are rejected: over a time of 0 any motion closes.
LEAST_PERIOD = 1.0e-6
# Fractions of Newton's step to be tried in turn, and penalties of long steps relative to the
# largest singular value.
SHARES = tuple(2.0**-power for power in range(13))
PENALTIES = tuple(10.0**power for power in range(-8, 1))
# Along directions with singular values below this fraction of the largest, the residual hardly
# changes: nearly closed motions form a curve. A straight step leaves it by an amount of second
# order; a second step, without these directions, leads back to it.
STIFF = 1.0e-3


class NoOrbit(VibroError):
    """There is no such orbit; the message says why."""


@dataclass(frozen=True)
class Shot:
    """A motion from a start over a period."""

    end: Floats
    """Displacements (m) and speeds (m/s) at the end."""
    matrix: Floats
    """Tangent map."""
    word: tuple[str, ...]
    """Sequence of events, see `event_words`."""
    times: tuple[float, ...]
    """Times of the events (s)."""
    jumps: tuple[tuple[str, ...], ...]
    """For each body the sequence of events that is constant in a family. Events without a common
    body may change their order, and crossings may appear, as the motion then changes smoothly; on a
    closed trace crossings count too, as one may be that of the seam."""
    instants: tuple[float, ...]
    """Times of the events in `jumps`, over all bodies (s)."""
    approach: float
    """Least normal speed at impacts and walls (m/s); infinite without any."""
    smooth: bool
    """Whether the matrix is the derivative of the motion, see `matrix_of`."""


@dataclass(frozen=True)
class Orbit:
    """A periodic orbit."""

    system: TraceSystem
    """The system, with the start of the orbit."""
    period: float
    """Period (s)."""
    state: Floats
    """Displacements (m) and speeds (m/s) at the start."""
    shot: Shot
    residual: float
    """Distance between end and start, relative to the size of the state."""
    energy: float
    """Energy conserved by impacts (J), see `energy_of`."""

    @property
    def reduced(self) -> Floats:
        """Tangent map transverse to the orbit, within its energy level."""
        flow = velocity(self.system, self.state)
        gradient = energy_gradient(self.system, self.state)
        scale = scale_of(self.system)
        normals = np.array([flow * scale, gradient / scale])
        basis = np.linalg.svd(normals)[2][2:].T
        matrix: Floats = basis.T @ ((self.shot.matrix * scale[:, None] / scale) @ basis)
        return matrix

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """Multipliers of the reduced map, the largest first."""
        values = np.linalg.eigvals(self.reduced).astype(np.complex128)
        return values[np.argsort(-np.abs(values), kind="stable")]

    @cached_property
    def part_gaps(self) -> dict[int, Floats]:
        """Gaps (m) of the orbit over 1/n of its period, by n = 2, 3, ….

        They are the differences between states midway between two events, and the corresponding
        states 1/n of the period later.
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
    def energy_start(self) -> float:
        """Energy (J) as in the summary of a run: each body's is 0 at rest at its lowest place."""
        total = 0.0
        for ball, start in enumerate(self.system.initial, 1):
            landscape = Landscape.of(self.system, ball)
            piece = self.system.trace.pieces[start.piece]
            rate = start.speed / landscape.path_scale(piece)
            total += float(landscape.energy(piece, start.position, rate))
        return total

    @property
    def stable(self) -> bool:
        """Whether no small perturbation grows exponentially."""
        return self.outside == 0

    @property
    def outside(self) -> int:
        """Number of multipliers outside the unit circle; these come first in `multipliers`."""
        error = np.where(self._at_one, PARTED, ROUNDING)
        return int(np.sum(~(np.abs(self.multipliers) < 1.0 + error)))

    @property
    def verdict(self) -> str:
        """Stability: ``stable``, ``unstable`` or ``neutral``.

        A neutral orbit has multipliers at 1 or -1: a small perturbation can grow linearly with the
        number of periods.
        """
        if not self.stable:
            return "unstable"
        return "neutral" if np.any(self._at_one) else "stable"

    def as_start(self, scenario: Scenario) -> Scenario:
        """Return the scenario with the start of the orbit."""
        return with_start_of(scenario, self.system)

    def __repr__(self) -> str:
        return f"<Orbit {' '.join(self.shot.word)}: period {self.period:.6g} s, {self.verdict}>"

    @property
    def _at_one(self) -> NDArray[np.bool_]:
        """Flags of multipliers at 1 or -1."""
        apart = np.minimum(np.abs(self.multipliers - 1.0), np.abs(self.multipliers + 1.0))
        return apart < PARTED


def scale_of(system: TraceSystem) -> Floats:
    """Return the factors that convert the numbers of a state to metres."""
    return np.tile([1.0, float(SYSTEM.time_scale(system))], len(system.bodies))


def _lengths(system: TraceSystem, body: int) -> list[float]:
    """Return the length (m) of the path of a body's centre on each piece."""
    pieces, radius = system.trace.pieces, system.bodies[body].radius
    return [one.path_scale(radius) * (one.angle_end - one.angle_start) for one in pieces]


def way_of(system: TraceSystem, body: int, piece: int, position: float) -> float:
    """Return the displacement (m) of a body's centre from the left end of its path."""
    on = system.trace.pieces[piece]
    along = on.path_scale(system.bodies[body].radius) * (position - on.angle_start)
    return sum(_lengths(system, body)[:piece]) + along


def place_of(system: TraceSystem, body: int, way: float) -> tuple[int, float]:
    """Return the piece and the position on it at a displacement `way` (m).

    Raises `NoOrbit` if it is off the trace.
    """
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
    return piece, min(position, on.angle_end)  # may exceed it by rounding


def state_of(system: TraceSystem) -> Floats:
    """Return the displacements (m) and speeds (m/s) at the start of a system."""
    starts = enumerate(system.initial)
    return np.ravel([(way_of(system, n, one.piece, one.position), one.speed) for n, one in starts])


def started(system: TraceSystem, state: Floats) -> TraceSystem:
    """Return the system with another start, which is not checked, see `admitted`."""
    pairs = enumerate(state.reshape(-1, 2).tolist())
    initial = tuple(InitialState(*place_of(system, n, way), speed) for n, (way, speed) in pairs)
    return replace(system, initial=initial)


def admitted(system: TraceSystem, state: Floats) -> TraceSystem:
    """Return the system with another start, after checking that it is valid.

    Raises `NoOrbit` if bodies would start off the trace, out of order (for example because only one
    of them has crossed the seam of a closed trace), overlapping or in a wall.
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
    """Return the speeds (m/s) and accelerations (m/s^2) of a state without contact."""
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
    """Return the weight of each body's energy in the energy conserved by impacts with k = 1.

    The translational law conserves the sum of m v^2, while rolling has the energies kappa m v^2/2.
    As free motion conserves the energy of each body, the sum of energies over kappa is conserved;
    it is multiplied by the first body's kappa, to equal the energy if all are equal.
    """
    kappa = np.array([body.kappa for body in system.bodies])
    return kappa[0] / kappa if LAWS[system.law].balances_mass else np.ones(len(kappa))


def energy_of(system: TraceSystem, state: Floats) -> float:
    """Return the energy (J) conserved by impacts, see `_shares`; heights from the left end."""
    total, initial = 0.0, started(system, state).initial
    for body, start, share in zip(system.bodies, initial, _shares(system), strict=True):
        x, height = system.trace.pieces[start.piece].body_centre(start.position, body.radius)
        if system.turning is not None:
            height -= 0.5 * system.turning.square / system.gravity * (x - system.turning.x) ** 2
        kinetic = 0.5 * body.kappa * start.speed * start.speed
        total += float(share) * (body.mass * (system.gravity * height + kinetic))
    return total


def energy_gradient(system: TraceSystem, state: Floats) -> Floats:
    """Return the gradient of `energy_of` for displacements (J/m) and speeds (J s/m)."""
    flow = velocity(system, state)
    inertia = _shares(system) * [body.rolling_mass for body in system.bodies]
    return np.column_stack([-inertia * flow[1::2], inertia * state[1::2]]).ravel()


def events_of(run: Run) -> list[tuple[float, str, float]]:
    """Return time (s), word and normal speed (m/s) of the events in a run, in order.

    For the words see `event_words`; the normal speed of a crossing is infinite.
    """
    # The tables of a run would take as long as all else in a shot.
    paths: Any = run.trajectory
    found: list[tuple[float, str, float]] = []
    for t, ball, speed, value in boundaries(paths)[["t", "ball", "speed", "value"]].tolist():
        if np.isnan(value):
            found.append((t, f"{ball}{'>' if speed > 0.0 else '<'}", np.inf))
        else:
            found.append((t, f"{ball}|", abs(value)))
    names = ["t", "a", "b", "normal_a", "speed_a_pre", "normal_b", "speed_b_pre"]
    for t, a, b, *ways in run.whole.logs["impacts"][names].tolist():
        # Across the seam of a closed trace a is the last body; of two bodies, it is always 1.
        one, other = sorted((a, b)) if len(run.system.bodies) == 2 else (a, b)
        found.append((t, impact_word(one + 1, other + 1), ways[0] * ways[1] - ways[2] * ways[3]))
    return sorted(found)


def shoot(system: TraceSystem, period: float) -> Shot:
    """Follow a motion and its tangent map over a period (s).

    Raises `NoOrbit` if it ends earlier, has lasting contact, or has impacts of laws that conserve
    different energies.
    """
    if not period > 0.0:
        raise NoOrbit("the period has become zero")
    run = simulate_system(system, period, MOST_IMPACTS)
    if run.end_cause == "collisions":
        raise NoOrbit(f"found {MOST_IMPACTS} impacts in a period, expected fewer")
    if run.end_cause != "time":
        raise NoOrbit(f"the motion ends: {run.end_cause.replace('_', ' ')}")
    if np.ptp(_shares(system)) > 0.0 and np.any(
        run.whole.logs["impacts"]["law"] != LAW_NAMES.index(system.law)
    ):
        raise NoOrbit("impacts by normal-impulse among translational ones do not conserve energy")
    matrix, smooth = matrix_of(run)
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
        smooth=smooth,
    )


def state_at(run: Run, t: Any) -> Floats:
    """Return displacements (m) and speeds (m/s) of a run at one instant (s) or several."""
    system, sample = run.system, run.sample(np.atleast_1d(t))
    start = np.array([piece.start_s for piece in system.trace.pieces])
    along = sample["s"] - start[sample["arc"] - 1]
    positions = np.where(np.isnan(sample["angle"]), along, sample["angle"])
    rows = zip(sample["ball"].tolist(), sample["arc"].tolist(), positions.tolist(), strict=True)
    ways = [way_of(system, ball - 1, arc - 1, position) for ball, arc, position in rows]
    return np.column_stack([ways, sample["speed"]]).reshape(*np.shape(t), -1)


def gone_through_once(orbit: Orbit) -> Orbit:
    """Return an orbit with its least period."""
    for times in range(len(orbit.shot.word), 1, -1):
        if any(one != one[: len(one) // times] * times for one in orbit.shot.jumps):
            continue
        once = over_period(orbit, orbit.period / times)
        if once.residual <= NEARLY_CLOSED:
            return once
    return orbit


def over_period(orbit: Orbit, period: float) -> Orbit:
    """Return an orbit with another period (s), in which it need not close."""
    shot = shoot(orbit.system, period)
    residual = residual_of(orbit.system, shot, orbit.state, None)
    return replace(orbit, period=period, shot=shot, residual=residual)


def begun_between(orbit: Orbit, longest: bool = False) -> Orbit:
    """Return an orbit that starts midway between two events: those around its present start.

    In a family the start is thus a well-defined state, and events do not pass it. An orbit so
    unstable that rounding lets it close from its old start only is returned unchanged. With
    ``longest`` it starts in the longest interval between events in which the bodies are in order;
    they are not between two bodies' crossings of the seam of a closed trace. Of several of equal
    length it is the one with the first of the following events by name, then by time.

    Raises `NoOrbit` if the orbit has no multipliers, or the motion from the new start other events.
    """
    if not orbit.shot.smooth:
        raise NoOrbit(
            "the orbit next to this start has no multipliers: found an impact without a derivative "
            f"among {' '.join(orbit.shot.word)}, as where a body collides twice at one instant"
        )
    times, period = orbit.shot.instants, orbit.period
    middles = [0.5 * (times[0] + times[-1] - period)]
    if longest:
        times, word = orbit.shot.times, orbit.shot.word
        gaps = np.diff([*times, times[0] + period])
        # Of an orbit that is its own time reversal rounding must not choose one of two intervals.
        sizes = np.round(gaps / gaps.max(), 6)
        following = [(-size, word[n + 1 :] + word[: n + 1]) for n, size in enumerate(sizes)]
        order = sorted(range(len(gaps)), key=following.__getitem__)
        middles = [times[n] + 0.5 * float(gaps[n]) for n in order]
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
    """Return the end minus the start of a motion, without full turns of a closed trace."""
    gap = end - start
    if system.trace.closed:
        rounds = np.array([sum(_lengths(system, body)) for body in range(len(system.bodies))])
        gap[..., ::2] -= rounds * np.round(gap[..., ::2] / rounds)
    return gap


def size_of(system: TraceSystem, state: Floats) -> float:
    """Return the size (m) of a state, to which residuals are relative."""
    return float(np.linalg.norm(state * scale_of(system)))


def newton(system: TraceSystem, state: Floats, period: float, energy: float | None = None) -> Orbit:
    """Return the periodic orbit near a start.

    The start of `system` is not used; `state` and `period` are an initial guess, with the same
    events as the orbit. Without its `energy` (J) the orbit nearest to the guess is sought. Raises
    `NoOrbit` if the method does not converge with the events of the guess, or the period tends
    to 0.
    """
    shot = shoot(admitted(system, state), period)
    walls = [end.restitution for end in (system.left_end, system.right_end) if end is not None]
    if any(event.endswith("|") for event in shot.word) and all(k != 1.0 for k in walls):
        raise NoOrbit(_LOSSY.format("impacts on walls", walls[0]))
    guess = _Guess(state, period, shot, residual_of(system, shot, state, energy))
    searches = (_shares_of_newton, False), (_steps_of_marquardt, False), (_steps_of_marquardt, True)
    for steps, bent in searches:
        found = _improved(system, guess, energy, steps, bent)
        if found.residual <= NEARLY_CLOSED:
            break
    else:
        raise NoOrbit(
            f"Newton's method does not converge: it reaches a motion that fails to close by "
            f"{found.residual:.2g} of the size of its state; start nearer to an orbit, or give "
            "another number of impacts or period"
        )
    if found.residual >= CLOSED:
        # Newton's steps go far where the rows nearly lose their rank; shorter ones come closer.
        found = _improved(system, found, energy, _steps_of_marquardt, bent=False)
    if found.period < LEAST_PERIOD * period:
        raise NoOrbit("the period has become zero")
    start, own = started(system, found.state), energy_of(system, found.state)
    return Orbit(start, found.period, found.state, found.shot, found.residual, own)


class _Guess(NamedTuple):
    """An iterate of Newton's method, and its residual."""

    state: Floats
    period: float
    shot: Shot
    residual: float


Steps = Callable[[Floats, Floats], Iterator[tuple[Floats, float]]]
"""Yields steps to try in turn, each with the factor by which it must reduce the residual."""


def _shares_of_newton(rows: Floats, right: Floats) -> Iterator[tuple[Floats, float]]:
    step = np.asarray(np.linalg.lstsq(rows, right, rcond=1e-12)[0], dtype=np.float64)
    yield from ((share * step, 1.0 - 0.1 * share) for share in SHARES)


def _steps_of_marquardt(rows: Floats, right: Floats) -> Iterator[tuple[Floats, float]]:
    """Yield Newton's step, then ever shorter steps that turn towards steepest descent.

    Near a stable orbit many motions nearly close and the rows nearly lose their rank. All fractions
    of Newton's step then go far along directions that hardly change the residual.
    """
    left, sizes, across = np.linalg.svd(rows, full_matrices=False)
    projected = left.T @ right
    for penalty in (EPSILON, *PENALTIES):
        yield across.T @ (projected * sizes / (sizes**2 + (penalty * sizes[0]) ** 2)), 0.95


def _improved(
    system: TraceSystem, guess: _Guess, energy: float | None, steps: Steps, bent: bool
) -> _Guess:
    """Iterate steps that reduce the residual and keep the events; return the last iterate.

    With ``bent`` a step that fails is followed by a correction, see `STIFF`.
    """
    scale, tau = scale_of(system), float(SYSTEM.time_scale(system))
    columns = np.append(1.0 / scale, 1.0 / (system.gravity * tau))  # scales periods by a speed
    for _ in range(MOST_STEPS):
        WORK.report(f"the motion closes to within {guess.residual:.1e}")
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
    """Return the iterate after a step, or None if its events differ."""
    state, period = guess.state + step[:-1], guess.period + float(step[-1])
    try:
        shot = shoot(admitted(system, state), period)
    except NoOrbit:
        return None
    if shot.jumps != guess.shot.jumps:
        return None
    return _Guess(state, period, shot, residual_of(system, shot, state, energy))


def residual_of(system: TraceSystem, shot: Shot, state: Floats, energy: float | None) -> float:
    """Return the relative residual of a motion: its gap, and its difference from the energy."""
    closing, kept = np.split(equations(system, shot, state, energy)[1], [len(state)])
    return float(np.linalg.norm(closing) + np.sum(np.abs(kept))) / size_of(system, state)


def equations(
    system: TraceSystem, shot: Shot, state: Floats, energy: float | None
) -> tuple[Floats, Floats]:
    """Return matrix and right-hand side (m) of the equations for changes of state and period."""
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

    Without a number, numbers up to 23 are tried and the nearest return is taken.

    Raises `NoOrbit` if the motion has too few impacts.
    """
    count = 24 if impacts is None else impacts
    run = simulate_system(system, longest, count + 1)
    times = run.collisions["t"]
    least = impacts or 1
    if len(times) <= least:
        cause = run.end_cause.replace("_", " ")
        raise NoOrbit(
            f"impacts: found {len(times)} until the run ended ({cause}), expected more than {least}"
        )
    wanted = range(1, len(times)) if impacts is None else range(impacts, impacts + 1)
    state, scale, best = state_of(system), scale_of(system), (np.inf, 0.0)
    flow = velocity(system, state) * scale
    for number in wanted:
        instants = np.linspace(times[number - 1], times[number], 402)[1:-1]
        gaps = gap_of(system, state, state_at(run, instants)) * scale
        squares = np.sum(gaps**2, axis=1)
        nearest = int(np.argmin(squares))
        gap, instant = gaps[nearest], float(instants[nearest])
        # To rounding: an error of the period would lead Newton's method to another energy.
        for _ in range(3):
            along = float(flow @ gap)
            if along**2 <= 0.5 * float(gap @ gap) * float(flow @ flow):
                break  # the gap does not lie mostly along the flow
            instant -= along / float(flow @ flow)
            instant = float(np.clip(instant, instants[0], instants[-1]))
            gap = gap_of(system, state, state_at(run, instant)) * scale
        best = min(best, (float(squares[nearest]), instant))
    return best[1]


def find_orbit(
    system: TraceSystem,
    impacts: int | None = None,
    period: float | None = None,
    longest: float | None = None,
) -> Orbit:
    """Return the periodic orbit near the start of a system.

    `impacts` and `period` (s) are those of the orbit, if known; without a period the first guess is
    the time of the nearest return. `longest` is how long (s) a return is waited for at most; None
    for as long as impacts follow.
    """
    if len(system.bodies) < 2:
        raise NoOrbit("found one body, expected two or more for an orbit of impacts")
    if all(k != 1.0 for k in system.restitution):
        raise NoOrbit(_LOSSY.format("impacts of bodies", system.restitution[0]))
    if period is None:
        period = nearest_return(system, impacts, longest)
    orbit = gone_through_once(newton(system, state_of(system), period))
    if not any(is_impact(word) for word in orbit.shot.word):
        raise NoOrbit("the orbit next to this start has no impact")
    # Bodies at rest also return, and within the tolerance of an orbit may have impacts as well.
    slow = NEARLY_CLOSED * size_of(system, orbit.state) / float(SYSTEM.time_scale(system))
    if orbit.shot.approach < slow:
        raise NoOrbit(
            "the orbit next to this start has an impact, with a body or a wall, of no speed"
        )
    return begun_between(orbit, longest=True)
