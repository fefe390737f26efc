"""Where bodies are at one instant: distances, what touches, accelerations without contacts."""

from __future__ import annotations

from collections.abc import Sequence

from vibro_cli.stress.highprecision.instant import Row, Touch
from vibro_cli.stress.highprecision.motion import Path, State
from vibro_cli.stress.highprecision.scene import Scene
from vibro_cli.stress.highprecision.taylor import Real, mp

NEAR = mp.mpf(10) ** -33  # m: closer than this is contact
NO_GAP = mp.mpf(10) ** -46  # m: what is left where bodies are put into contact
# What the solver takes for contact at the start (m, relative).
TOUCHING = 16 * 2.0**-52
LEFT_WALL, RIGHT_WALL = -1, -2  # beside the numbers of pairs


class Arrangement:
    """Bodies of a scene, their places and speeds.

    Parameters
    ----------
    scene
        What is run; ``states`` are at first those of its start.
    """

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
        """Path of a body on its piece."""
        return Path(self.scene, ball, self.states[ball].piece)

    def centre(self, ball: int) -> tuple[Real, Real]:
        """Centre of a body."""
        return self.path(ball).centre(self.states[ball].place)

    def reach(self, pair: int) -> Real:
        """Distance (m) of the centres of a pair in contact."""
        a, b = self.pairs[pair]
        return self.scene.bodies[a].radius + self.scene.bodies[b].radius

    def gap(self, pair: int) -> Real:
        """Distance (m) of the surfaces of a pair."""
        (ax, ay), (bx, by) = (self.centre(n) for n in self.pairs[pair])
        return mp.hypot(bx - ax, by - ay) - self.reach(pair)

    def into_contact(self) -> None:
        """Put bodies that touch up to rounding exactly into contact."""
        for number, (a, b) in enumerate(self.pairs):
            size = max(1, *(abs(x) for n in (a, b) for x in self.centre(n)))
            while NO_GAP < abs(gap := self.gap(number)) <= TOUCHING * size:
                rate = self.row(number)[b] / self.path(b).per_length
                old = self.states[b]
                self.states[b] = old._replace(place=old.place - gap / rate)

    def row(self, pair: int) -> Row:
        """Factors of the speeds in the speed of parting of a touching pair."""
        a, b = self.pairs[pair]
        (ax, ay), (bx, by) = (self.centre(n) for n in (a, b))
        (ac, as_), (bc, bs) = (self.path(n).tangent(self.states[n].place) for n in (a, b))
        size = mp.hypot(bx - ax, by - ay)
        nx, ny = (bx - ax) / size, (by - ay) / size
        return {a: -(nx * ac + ny * as_), b: nx * bc + ny * bs}

    def wall_place(self, ball: int, wall: int) -> Real | None:
        """Where a body on the last piece touches a wall; None if there is none, or not there."""
        right = wall == RIGHT_WALL
        piece = len(self.scene.pieces) - 1 if right else 0
        restitution = self.scene.walls[1 if right else 0]
        if restitution is None or self.states[ball].piece != piece or self.scene.closed:
            return None
        path = self.path(ball)
        offset = path.body.radius
        if path.shape.sign:
            offset = mp.asin(offset / path.rho)
        place = path.shape.high - offset if right else path.shape.low + offset
        return place if path.shape.low < place < path.shape.high else None

    def touches(self, held: set[int]) -> list[Touch]:
        """Everything that touches now; pairs that are held do."""
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

    def mobility(self) -> list[Real]:
        """1/M of all bodies."""
        return [1 / (body.kappa * body.mass) for body in self.scene.bodies]

    def accelerations(self, touches: Sequence[Touch]) -> list[Real]:
        """Accelerations of parting without contact forces."""
        free = [self._free(ball) for ball in range(len(self.states))]
        found = []
        for touch in touches:
            value = mp.fsum(touch.row[n] * free[n] for n in touch.bodies)
            if len(touch.bodies) == 2:
                value += self._bend(*touch.bodies)
            found.append(value)
        return found

    def _free(self, ball: int) -> Real:
        """Acceleration of a body along its path without contact forces."""
        path = self.path(ball)
        c, s = path.tangent(self.states[ball].place)
        arm = self.centre(ball)[0] - self.scene.axis
        return (self.scene.turning_square * arm * c - self.scene.gravity * s) / path.body.kappa

    def _bend(self, a: int, b: int) -> Real:
        """What the curvatures of the paths and the turning of the normal add to the parting."""
        (ax, ay), (bx, by) = (self.centre(n) for n in (a, b))
        size = mp.hypot(bx - ax, by - ay)
        total, velocity = mp.zero, []
        for sign, n in ((-1, a), (1, b)):
            path, state = self.path(n), self.states[n]
            c, s = path.tangent(state.place)
            inward = ((by - ay) * c - (bx - ax) * s) / size
            total += sign * path.curvature * state.speed**2 * inward
            velocity.append((state.speed * c, state.speed * s))
        (au, av), (bu, bv) = velocity
        return total + ((bu - au) ** 2 + (bv - av) ** 2) / size
