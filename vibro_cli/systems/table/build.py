"""Build the system from a scenario of a table, and report all its faults together."""

from __future__ import annotations

import math
from collections.abc import Iterator

from vibro_cli.assemble import Problems, bodies_of
from vibro_cli.mechanics.system import Body, touching_distance
from vibro_cli.systems.table import system
from vibro_cli.systems.table.scenario import TableBall, TableScenario
from vibro_cli.systems.table.scenario import Wall as WallTable
from vibro_cli.systems.table.system import InitialState, Point, TableSystem, Wall


def build(scenario: TableScenario) -> TableSystem:
    """Return the system of a scenario, after checking its mechanics.

    Raises ScenarioError with every problem: masses too extreme for doubles, a polygon that
    intersects itself, and balls that do not fit the wall, reach into it, or overlap.
    """
    problems = Problems(scenario)
    bodies = bodies_of(scenario.balls, problems)
    wall = _wall(scenario.wall, problems)
    problems.raise_if_any()
    initial = tuple(InitialState((ball.x, ball.y), velocity_of(ball)) for ball in scenario.balls)
    if wall is not None:
        _check_wall(scenario, wall, bodies, problems)
    _check_overlaps(scenario, bodies, problems)
    problems.raise_if_any()
    return TableSystem(
        bodies=bodies,
        initial=initial,
        wall=wall,
        restitution=1.0 if scenario.collision.k is None else scenario.collision.k,
        law=scenario.collision.law,
        inadmissible=scenario.collision.inadmissible,
    )


def velocity_of(ball: TableBall) -> Point:
    """Return the initial velocity of a ball (m/s)."""
    if ball.speed is not None and ball.direction is not None:
        return ball.speed * math.cos(ball.direction), ball.speed * math.sin(ball.direction)
    return ball.velocity_x or 0.0, ball.velocity_y or 0.0


def _wall(table: WallTable | None, problems: Problems) -> Wall | None:
    if table is None:
        return None
    inside = table.side == "inside"
    centre = (table.x, table.y)
    if table.shape == "ellipse":
        axes = (table.semi_axis_x or 0.0, table.semi_axis_y or 0.0)
        return Wall("ellipse", inside, table.k, centre, axes)
    if table.shape == "circle":
        return Wall("circle", inside, table.k, centre, (table.radius or 0.0,) * 2)
    if table.shape == "rectangle":
        x, y = 0.5 * (table.width or 0.0), 0.5 * (table.depth or 0.0)
        corners = ((-x, -y), (x, -y), (x, y), (-x, y))
        moved = tuple((table.x + dx, table.y + dy) for dx, dy in corners)
        return Wall("polygon", inside, table.k, corners=moved, named=table.shape)
    points = tuple((x, y) for x, y in table.corners or ())
    wrong = system.wrong_with_polygon(points)
    if wrong:
        problems.add("wall.corners", wrong, "sides that meet only at their common corners")
        return None
    return Wall("polygon", inside, table.k, corners=points)


def _check_wall(
    scenario: TableScenario, wall: Wall, bodies: tuple[Body, ...], problems: Problems
) -> None:
    """Check that every ball fits the wall and does not overlap it at the start."""
    for number, (ball, body) in enumerate(zip(scenario.balls, bodies, strict=True), 1):
        limit = system.largest_radius(wall)
        if body.radius >= limit:
            expected = f"less than {limit!r}, the least radius of curvature of the wall"
            problems.add(f"balls[{number}].radius", repr(body.radius), expected)
            continue
        free = system.distance_to_wall(wall, (ball.x, ball.y)) - body.radius
        if free < -system.rounding(wall, (ball.x, ball.y)):
            side = "inside" if wall.inside else "outside"
            found = f"ball {number} reaching {-free:.6g} m into the wall"
            problems.add(f"balls[{number}].x", found, f"a position {side} the wall, clear of it")


def _check_overlaps(scenario: TableScenario, bodies: tuple[Body, ...], problems: Problems) -> None:
    for b, a, touch, apart in sorted(_overlaps(scenario, bodies)):
        found = f"balls {a + 1} and {b + 1} that overlap by {touch - apart:.6g} m"
        expected = f"centres at least 2 sqrt(r_a r_b) = {touch!r} m apart"
        problems.add(f"balls[{b + 1}].x", found, expected)


def _overlaps(
    scenario: TableScenario, bodies: tuple[Body, ...]
) -> Iterator[tuple[int, int, float, float]]:
    """Yield pairs of overlapping balls, the later first, their contact and actual distances."""
    places = [(ball.x, ball.y) for ball in scenario.balls]
    width = 2.0 * max(body.radius for body in bodies)
    order = sorted(range(len(places)), key=places.__getitem__)
    for at, first in enumerate(order):
        left, level = places[first]
        for second in map(order.__getitem__, range(at + 1, len(order))):
            x, y = places[second]
            if x - left > width:
                break  # the remaining balls lie even farther along x
            if abs(y - level) > width:
                continue
            a, b = min(first, second), max(first, second)
            touch = touching_distance(bodies[a], bodies[b])
            apart = math.hypot(x - left, y - level)
            if apart < touch * (1.0 - 1e-14) - 1e-15 * sum(map(abs, places[a])):
                yield b, a, touch, apart
