"""Build the system from a scenario of springs, and report all its faults together."""

from __future__ import annotations

from vibro_cli.assemble import Problems, bodies_of
from vibro_cli.mechanics.system import Body, touching_distance
from vibro_cli.systems.springs.scenario import SpringsScenario
from vibro_cli.systems.springs.system import InitialState, Spring, SpringsSystem


def build(scenario: SpringsScenario) -> SpringsSystem:
    """Return the system of a scenario, after checking its mechanics.

    Raises ScenarioError with every problem: masses too extreme for doubles, bodies that start out
    of order or overlap, and bodies that could touch over a small one between them.
    """
    problems = Problems(scenario)
    bodies = bodies_of(scenario.balls, problems)
    initial = _initial(scenario, bodies, problems)
    _check_neighbours(bodies, problems)
    problems.raise_if_any()
    springs = [ball.spring for ball in scenario.balls]
    return SpringsSystem(
        bodies=bodies,
        springs=tuple(Spring(s.stiffness, s.length, s.height, s.foot) for s in springs),
        initial=initial,
        restitution=scenario.collision.k,
        law=scenario.collision.law,
        inadmissible=scenario.collision.inadmissible,
    )


def _initial(
    scenario: SpringsScenario, bodies: tuple[Body, ...], problems: Problems
) -> tuple[InitialState, ...]:
    """Return the initial states; report bodies that are out of order or overlap."""
    states: list[InitialState] = []
    for number, (ball, body) in enumerate(zip(scenario.balls, bodies, strict=True), 1):
        position = ball.position
        touch = touching_distance(bodies[number - 2], body) if number > 1 else 0.0
        if position is None:
            position = states[-1].position + touch
        elif number > 1:
            room = position - states[-1].position - touch
            if room < -1e-15 * (abs(position) + abs(states[-1].position)):
                found = f"{position!r}, {-room:.6g} m too far to the left"
                expected = (
                    f"a position to the right of body {number - 1}: {position - room!r} m or more"
                )
                problems.add(f"balls[{number}].position", found, expected)
        speed = ball.speed if ball.speed is not None else (ball.omega or 0.0) * body.radius
        states.append(InitialState(position, speed))
    return tuple(states)


def _check_neighbours(bodies: tuple[Body, ...], problems: Problems) -> None:
    """Check that bodies which are not neighbours cannot touch over those between them."""
    for first in range(len(bodies)):
        reach = 0.0
        for second in range(first + 1, len(bodies)):
            reach += touching_distance(bodies[second - 1], bodies[second])
            over = touching_distance(bodies[first], bodies[second])
            if second > first + 1 and over >= reach:
                between = range(first + 1, second)
                small = min(between, key=lambda index: bodies[index].radius)
                expected = f"one so large that bodies {first + 1} and {second + 1} cannot touch"
                path = f"balls[{small + 1}].radius"
                problems.add(path, repr(bodies[small].radius), f"{expected} over it")
