"""What happens at one instant: impacts of all that touches, and what stays in contact after it.

Bodies and walls alike are constraints: a row ``c`` of factors of the bodies' speeds such that
``c v`` is the speed of parting. All constraints that close are solved jointly, each with its own
restitution, a wall as a body of infinite mass; then those that close now, and so on to the end, or
to the limit of the sequence. What has no speed of parting then stays in contact if the forces
press it (a linear complementarity problem).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vibro_cli.stress.highprecision.scene import Body, Scene
from vibro_cli.stress.highprecision.taylor import Real, mp

# Speeds below this share of the fastest are zero.
ZERO = mp.mpf(10) ** -30
# Of a sequence that does not end, so many impacts are carried out.
MOST_ROUNDS = 20_000

Row = dict[int, Real]


class Inadmissible(Exception):
    """The law drives bodies into one another, and nothing else is to be done then."""


@dataclass(frozen=True)
class Touch:
    """One pair of bodies that touch, or a body at a wall."""

    bodies: tuple[int, ...]  # a, b; or the body alone
    row: Row
    restitution: Real
    key: int  # of the pair; -1, -2 for the walls


class Laws:
    """Impulses of the three laws on bodies of a scene."""

    def __init__(self, scene: Scene, law: str) -> None:
        self.scene, self.law = scene, law

    def _of(self, touch: Touch, law: str) -> tuple[Row, Row]:
        """Row of the speed that a law acts on, and the changes of speed by its unit of impulse."""
        if law == "normal-impulse":
            inertia = {n: self._body(n).kappa * self._body(n).mass for n in touch.bodies}
            return touch.row, {n: touch.row[n] / inertia[n] for n in touch.bodies}
        if len(touch.bodies) == 1:
            sign = {touch.bodies[0]: mp.sign(touch.row[touch.bodies[0]])}
        else:
            sign = dict(zip(touch.bodies, (-1, 1), strict=True))
        row, change = {}, {}
        for n in touch.bodies:
            body = self._body(n)
            if law == "hedrih":
                row[n] = sign[n] / body.radius
                change[n] = sign[n] / (body.kappa * body.mass * body.radius)
            else:
                row[n], change[n] = mp.mpf(sign[n]), sign[n] / body.mass
        return row, change

    def _body(self, number: int) -> Body:
        return self.scene.bodies[number]

    def solve(self, touches: Sequence[Touch], speeds: list[Real], law: str) -> list[Real]:
        """Speeds after the joint impact of some touches, each with its restitution."""
        rows, changes = zip(*(self._of(touch, law) for touch in touches), strict=True)
        wanted = [
            -(1 + touch.restitution) * speed_of(row, speeds)
            for touch, row in zip(touches, rows, strict=True)
        ]
        return self._apply(rows, changes, wanted, speeds)

    def equalise(self, touches: Sequence[Touch], speeds: list[Real], law: str) -> list[Real]:
        """Speeds when the bounces of some touches are at an end: no speed along the normals."""
        rows = [touch.row for touch in touches]
        changes = [self._of(touch, law)[1] for touch in touches]
        wanted = [-speed_of(row, speeds) for row in rows]
        return self._apply(rows, changes, wanted, speeds)

    def _apply(
        self,
        rows: Sequence[Row],
        changes: Sequence[Row],
        wanted: Sequence[Real],
        speeds: list[Real],
    ) -> list[Real]:
        """Speeds changed by impulses such that every row's speed changes as is wanted."""
        impulses = solve_rows(rows, changes, wanted)
        after = list(speeds)
        for impulse, change in zip(impulses, changes, strict=True):
            for n, value in change.items():
                after[n] += impulse * value
        return after


def speed_of(row: Row, speeds: Sequence[Real]) -> Real:
    """Speed of parting of a constraint."""
    return mp.fsum(value * speeds[n] for n, value in row.items())


def solve_rows(rows: Sequence[Row], changes: Sequence[Row], wanted: Sequence[Real]) -> list[Real]:
    """Impulses (or forces) by which the rows change as is wanted."""
    size = len(rows)
    matrix = mp.matrix(size, size)
    for i, row in enumerate(rows):
        for j, change in enumerate(changes):
            matrix[i, j] = mp.fsum(row[n] * change[n] for n in row if n in change)
    if size == 1:
        return [wanted[0] / matrix[0, 0]]
    return list(mp.lu_solve(matrix, mp.matrix(list(wanted))))


def runs_of(touches: Sequence[Touch]) -> list[list[Touch]]:
    """Touches in sets that share bodies."""
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
                    raise Inadmissible
                law = "normal-impulse"
                after = laws.solve(run, speeds, law)
            # Runs share no bodies: none changes what another one meets.
            speeds = after
            used |= {touch.key: law for touch in run}
    raise ArithmeticError("the impacts of one instant do not end")


def _with_forces(
    touches: Sequence[Touch],
    held: Sequence[int],
    accelerations: Sequence[Real],
    mobility: Sequence[Real],
) -> list[Real]:
    """Accelerations of parting when forces keep some of the touches together."""
    if not held:
        return list(accelerations)
    rows = [touches[n].row for n in held]
    changes = [{i: value * mobility[i] for i, value in row.items()} for row in rows]
    forces = solve_rows(rows, changes, [-accelerations[n] for n in held])
    found = []
    for touch, value in zip(touches, accelerations, strict=True):
        for force, change in zip(forces, changes, strict=True):
            value += force * mp.fsum(touch.row[i] * change[i] for i in touch.row if i in change)
        found.append(value)
    return found


def pressing(
    touches: Sequence[Touch],
    accelerations: Sequence[Real],
    mobility: Sequence[Real],
    size: Real,
) -> tuple[list[Touch], list[Touch]]:
    """Of touches without speed those that stay: pressed ones, and ones with no force at all.

    ``accelerations`` are those of parting without contact forces. What presses once does so in the
    end (a force presses the bodies more against their other neighbours), so that the set only
    grows. ``size`` is an acceleration beside which rounding is nothing.
    """
    held: list[int] = []
    while True:
        now = _with_forces(touches, held, accelerations, mobility)
        free = [n for n in range(len(touches)) if n not in held]
        more = [n for n in free if now[n] < -ZERO * size]
        if not more:
            idle = [touches[n] for n in free if now[n] <= ZERO * size]
            return [touches[n] for n in held], idle
        held += more


def closing_acceleration(
    touches: Sequence[Touch],
    accelerations: Sequence[Real],
    mobility: Sequence[Real],
    size: Real,
) -> Real:
    """Acceleration with which the last touch closes, among the others, which have no speed."""
    held, _ = pressing(touches[:-1], accelerations[:-1], mobility, size)
    kept = [n for n in range(len(touches) - 1) if touches[n] in held]
    return -_with_forces(touches, kept, accelerations, mobility)[-1]
