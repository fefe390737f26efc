"""Events of one instant: touching bodies, their simultaneous impacts, lasting contacts.

Contacts of pairs and with walls are constraints: a row ``c`` of factors of the bodies' speeds such
that ``c v`` is the separation speed. All closing constraints are solved jointly, each with its own
restitution, with a wall as a body of infinite mass; then those that close afterwards, and so on, to
the end or to the limit of the sequence. Constraints without separation speed then stay in contact
if the forces press them (a linear complementarity problem).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vibro_cli.stress.oracles.motion import Course, Group, State, real, squared_distance
from vibro_cli.stress.oracles.scene import Path, Real, Scene, mp, weight_and_response

# Speeds below this share of the greatest count as zero.
ZERO = mp.mpf(10) ** -30
# Relative difference below which two directions count as equal, for doubles.
SAME_LINE = mp.mpf(10) ** -12
# Number of rounds after which a sequence of impacts counts as endless.
MOST_ROUNDS = 20_000

Row = dict[int, Real]


class Inadmissible(Exception):
    """Raised if the law drives bodies into each other, and no other law is substituted.

    `approach` is the greatest approach speed (m/s) of touching bodies.
    """

    def __init__(self, approach: Real) -> None:
        super().__init__(approach)
        self.approach = approach


@dataclass(frozen=True)
class Touch:
    """A pair of bodies that touch, or a body at a wall."""

    bodies: tuple[int, ...]  # a, b; or the body alone
    row: Row
    restitution: Real
    key: int  # of the pair; -1, -2 for the walls


class Laws:
    """Impulses of the impact laws on the bodies of a scene."""

    def __init__(self, scene: Scene, law: str) -> None:
        self.scene, self.law = scene, law

    def _of(self, touch: Touch, law: str) -> tuple[Row, Row]:
        """Return the row of the speed on which a law acts, and the changes by its unit impulse."""
        row, change = {}, {}
        signs = [mp.sign(touch.row[n]) for n in touch.bodies] if touch.key < 0 else [-1, 1]
        for n, sign in zip(touch.bodies, signs, strict=True):
            weight, response = weight_and_response(law, self.scene.bodies[n], sign * touch.row[n])
            row[n], change[n] = sign * weight, sign * response
        return row, change

    def act_along(self, touch: Touch) -> bool:
        """Return whether the law acts on the separation speed of a touch, up to a factor."""
        row, _ = self._of(touch, self.law)
        shares = [row[n] / touch.row[n] for n in touch.bodies]
        return bool(abs(shares[0] - shares[-1]) <= SAME_LINE * abs(shares[0]))

    def solve(self, touches: Sequence[Touch], speeds: list[Real], law: str) -> list[Real]:
        """Return the speeds after the simultaneous impact of touches, each with its restitution."""
        rows, changes = zip(*(self._of(touch, law) for touch in touches), strict=True)
        return self._apply(rows, changes, [1 + touch.restitution for touch in touches], speeds)

    def equalise(self, touches: Sequence[Touch], speeds: list[Real], law: str) -> list[Real]:
        """Return the speeds at the end of the bounces of touches: without separation speeds."""
        rows = [touch.row for touch in touches]
        changes = [self._of(touch, law)[1] for touch in touches]
        return self._apply(rows, changes, [mp.one] * len(rows), speeds)

    def _apply(
        self,
        rows: Sequence[Row],
        changes: Sequence[Row],
        factors: Sequence[Real],
        speeds: list[Real],
    ) -> list[Real]:
        """Return the speeds after impulses that take these multiples of the rows' speeds away."""
        wanted = [-x * speed_of(row, speeds) for x, row in zip(factors, rows, strict=True)]
        after = list(speeds)
        for impulse, change in zip(solve_rows(rows, changes, wanted), changes, strict=True):
            for n, value in change.items():
                after[n] += impulse * value
        return after


def speed_of(row: Row, speeds: Sequence[Real]) -> Real:
    """Return the separation speed of a constraint."""
    return mp.fsum(value * speeds[n] for n, value in row.items())


def solve_rows(rows: Sequence[Row], changes: Sequence[Row], wanted: Sequence[Real]) -> list[Real]:
    """Return the impulses (or forces) that change the rows by the wanted amounts."""
    size = len(rows)
    matrix = mp.matrix(size, size)
    for i, row in enumerate(rows):
        for j, change in enumerate(changes):
            matrix[i, j] = mp.fsum(row[n] * change[n] for n in row if n in change)
    if size == 1:
        return [wanted[0] / matrix[0, 0]]
    return list(mp.lu_solve(matrix, mp.matrix(list(wanted))))


def runs_of(touches: Sequence[Touch]) -> list[list[Touch]]:
    """Return the touches in connected sets, which share bodies."""
    found: list[list[Touch]] = []
    for touch in touches:
        joined = [one for one in found if any(set(touch.bodies) & set(t.bodies) for t in one)]
        rest = [one for one in found if one not in joined]
        found = [*rest, [touch, *(t for one in joined for t in one)]]
    return found


def collide(
    laws: Laws, touches: Sequence[Touch], speeds: list[Real], substitute: bool
) -> tuple[list[Real], dict[int, str]]:
    """Carry out all impacts of an instant.

    Returns the speeds after them, and the law of the last impact of every touch that had one.
    """
    least = -ZERO * max(abs(speed) for speed in speeds)
    used: dict[int, str] = {}
    for _ in range(MOST_ROUNDS):
        closing = [touch for touch in touches if speed_of(touch.row, speeds) < least]
        if not closing:
            return speeds, used
        for run in runs_of(closing):
            law = laws.law
            after = laws.solve(run, speeds, law)
            if any(speed_of(touch.row, after) < least for touch in run):
                if not substitute:
                    raise Inadmissible(max(-speed_of(touch.row, speeds) for touch in run))
                law = "normal-impulse"
                after = laws.solve(run, speeds, law)
            # Runs share no bodies, so their order does not matter.
            speeds = after
            used |= {touch.key: law for touch in run}
    raise ArithmeticError("the impacts of one instant do not end")


NEAR = mp.mpf(10) ** -33  # m: greatest gap in contact
NO_GAP = mp.mpf(10) ** -46  # m: remaining gap of bodies that are put into contact
# Relative gap up to which the solver assumes contact at the start.
TOUCHING = 16 * 2.0**-52
LEFT_WALL, RIGHT_WALL = -1, -2  # keys of the walls, besides the numbers of pairs


class Arrangement:
    """The bodies of a scene with their ``states`` (places and speeds), initially its start."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        count = len(scene.bodies)
        self.pairs = [(n, n + 1) for n in range(count - 1)]
        if scene.closed and count > 2:
            self.pairs.append((count - 1, 0))
        self.states = [State(*start) for start in scene.starts]

    @property
    def speeds(self) -> list[Real]:
        """Speeds of all bodies."""
        return [state.speed for state in self.states]

    @speeds.setter
    def speeds(self, speeds: Sequence[Real]) -> None:
        self.states = [
            state._replace(speed=speed) for state, speed in zip(self.states, speeds, strict=True)
        ]

    def path(self, ball: int) -> Path:
        """Return the path of a body on its piece."""
        return Path(self.scene, ball, self.states[ball].piece)

    def centre(self, ball: int) -> tuple[Real, Real]:
        """Return the centre of a body (m)."""
        return self.path(ball).centre(self.states[ball].place)

    def reach(self, pair: int) -> Real:
        """Return the distance (m) of the centres of a pair in contact."""
        a, b = self.pairs[pair]
        return self.scene.bodies[a].radius + self.scene.bodies[b].radius

    def gap(self, pair: int) -> Real:
        """Return the distance (m) of the surfaces of a pair."""
        (ax, ay), (bx, by) = (self.centre(n) for n in self.pairs[pair])
        return mp.hypot(bx - ax, by - ay) - self.reach(pair)

    def into_contact(self) -> None:
        """Move bodies that touch up to rounding exactly into contact."""
        for number, (a, b) in enumerate(self.pairs):
            size = max(1, *(abs(x) for n in (a, b) for x in self.centre(n)))
            while NO_GAP < abs(gap := self.gap(number)) <= TOUCHING * size:
                rate = self.row(number)[b] / self.path(b).per_length
                old = self.states[b]
                self.states[b] = old._replace(place=old.place - gap / rate)

    def row(self, pair: int) -> Row:
        """Return the factors of the speeds in the separation speed of a touching pair."""
        a, b = self.pairs[pair]
        (ax, ay), (bx, by) = (self.centre(n) for n in (a, b))
        (ac, as_), (bc, bs) = (self.path(n).tangent(self.states[n].place) for n in (a, b))
        size = mp.hypot(bx - ax, by - ay)
        nx, ny = (bx - ax) / size, (by - ay) / size
        return {a: -(nx * ac + ny * as_), b: nx * bc + ny * bs}

    def wall_place(self, ball: int, wall: int) -> Real | None:
        """Return the place where a body touches a wall of its piece, None if there is no wall."""
        right = wall == RIGHT_WALL
        piece = len(self.scene.pieces) - 1 if right else 0
        restitution = self.scene.walls[1 if right else 0]
        if restitution is None or self.states[ball].piece != piece or self.scene.closed:
            return None
        path = self.path(ball)
        place = path.at_wall(right)
        return place if path.shape.low < place < path.shape.high else None

    def touches(self, held: set[int]) -> list[Touch]:
        """Return all present touches, including those of held pairs."""
        found = []
        for number, pair in enumerate(self.pairs):
            if number in held or abs(self.gap(number)) < NEAR:
                k = self.scene.restitution[number]
                found.append(Touch(pair, self.row(number), k, number))
        for wall, sign, k in zip((LEFT_WALL, RIGHT_WALL), (1, -1), self.scene.walls, strict=True):
            for ball, state in enumerate(self.states):
                place = self.wall_place(ball, wall)
                if place is not None and abs(state.place - place) < NEAR:
                    found.append(Touch((ball,), {ball: mp.mpf(sign)}, k, wall))
        return found

    def accelerations(self, touches: Sequence[Touch], held: Sequence[int] = ()) -> list[Real]:
        """Return the separation accelerations of touches if forces hold some together (indices)."""
        courses = [self._course(ball) for ball in range(len(self.states))]
        found = []
        for touch in touches:
            one, *other = touch.bodies
            if other:  # of the distance, from that of its square
                reach = self.scene.bodies[one].radius + self.scene.bodies[other[0]].radius
                square = squared_distance(courses[one], courses[other[0]])
                found.append(real(square[2]) / reach)
            else:
                found.append(touch.row[one] * real(courses[one].rate[0]))
        if not held:
            return found
        rows = [touches[n].row for n in held]
        mobility = [1 / (body.kappa * body.mass) for body in self.scene.bodies]
        changes = [{i: value * mobility[i] for i, value in row.items()} for row in rows]
        forces = solve_rows(rows, changes, [-found[n] for n in held])
        for force, change in zip(forces, changes, strict=True):
            for n, touch in enumerate(touches):
                shared = (touch.row[i] * change[i] for i in touch.row if i in change)
                found[n] += force * mp.fsum(shared)
        return found

    def pressing(self, touches: Sequence[Touch]) -> tuple[list[int], list[int]]:
        """Return the touches without speed that stay: the pressed ones, and those without a force.

        They are given by their indices. A touch once pressed stays pressed (its force presses the
        bodies more against their other neighbours), so that the set only grows.
        """
        held: list[int] = []
        rounding = ZERO * self.scene.gravity
        while True:
            now = self.accelerations(touches, held)
            free = [n for n in range(len(touches)) if n not in held]
            more = [n for n in free if now[n] < -rounding]
            if not more:
                return held, [n for n in free if now[n] <= rounding]
            held += more

    def closing_acceleration(self, touches: Sequence[Touch]) -> Real:
        """Return the acceleration with which the last touch closes; the others have no speed."""
        held, _ = self.pressing(touches[:-1])
        return -self.accelerations(touches, held)[-1]

    def _course(self, ball: int) -> Course:
        """Return the first terms of a body's motion without contact forces, in powers of 1 s."""
        group = Group(self.scene, [ball], [self.states[ball]], [])
        group.expand(mp.one, 2)
        return group.courses[0]
