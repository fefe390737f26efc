"""Laws that every run obeys, on random traces of one to seven pieces with one to six bodies."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, reject
from hypothesis import strategies as st

from tests.strategies import FEWER, SETTINGS, mirrored, possible, scenarios
from tests.systems.trace.test_continuing import assert_same_results
from vibro_cli.mechanics.system import InitialState, TraceSystem
from vibro_cli.stress.oracles.sensitivity import CHANGE, amplification
from vibro_cli.stress.scenes import scene
from vibro_cli.systems.driver import ENGINES
from vibro_cli.systems.run import Run
from vibro_cli.systems.trace import simulate_system

EPSILON = 2.0**-52
pytestmark = pytest.mark.usefixtures("no_hang")
TIME = 6.0


def run_of(document: dict[str, Any]) -> Run:
    """Return the run of a document; a document that the mechanics refuse is no example."""
    system = possible(document)
    if system is None:
        reject()
    stop = document["stop"]
    return simulate_system(system, stop["time"], stop["collisions"])


def single(run: Run) -> list[int]:
    """Rows that are one impact of one pair (not part of a joint one, not the end of bouncing)."""
    table = run.collisions
    return [
        row for row in range(len(table["n"]))
        if not table["simultaneous"][row] and not table["contact"][row]
    ]  # fmt: skip


def law_speeds(run: Run, row: int, when: str) -> tuple[float, float]:
    """The relative speed that the row's law acts on, of approach, and the size of its terms."""
    table = run.collisions
    va, vb = (float(table[f"speed_{end}_{when}"][row]) for end in "ab")
    if table["law"][row] == "hedrih":
        bodies = [run.system.bodies[int(table[f"ball_{end}"][row]) - 1] for end in "ab"]
        va, vb = va / bodies[0].radius, vb / bodies[1].radius
    elif table["law"][row] == "normal-impulse":
        name = "approach_speed" if when == "pre" else "separation_speed"
        sign = 1.0 if when == "pre" else -1.0
        return sign * float(table[name][row]), abs(va) + abs(vb)
    return va - vb, abs(va) + abs(vb)


@SETTINGS
@given(document=scenarios())
def test_restitution_on_the_laws_own_speed(document: dict[str, Any]) -> None:
    run = run_of(document)
    for row in single(run):
        before, size = law_speeds(run, row, "pre")
        after, size_after = law_speeds(run, row, "post")
        k = run.system.restitution[int(run.collisions["ball_a"][row]) - 1]
        assert abs(after + k * before) <= 32 * EPSILON * (size + size_after)


@SETTINGS
@given(document=scenarios())
def test_impacts_approach_and_part(document: dict[str, Any]) -> None:
    run = run_of(document)
    table = run.collisions
    for row in single(run):
        size = float(abs(table["speed_a_pre"][row]) + abs(table["speed_b_pre"][row]))
        assert table["approach_speed"][row] >= -16 * EPSILON * size
        if table["admissible"][row] or table["substituted"][row]:
            assert table["separation_speed"][row] >= -16 * EPSILON * size


def rounding_of_energy(run: Run, row: int, end: str, carried: float) -> float:
    """How far (m) the rounding of an energy (J) that a body carries moves it along its arc.

    A flight ends in the nearest state of its energy: ``2 S C/(4 S^2 C^2 + 4 P^2)`` for a change of
    the energy by 1 J over the weight.
    """
    table = run.collisions
    body = run.system.bodies[table[f"ball_{end}"][row] - 1]
    piece = run.system.trace.pieces[table[f"arc_{end}"][row] - 1]
    if piece.is_line or carried == 0.0:
        return 0.0
    gravity, speed = run.system.gravity, float(table[f"speed_{end}_pre"][row])
    sine = abs(math.sin(table[f"angle_{end}"][row]))
    square = sine * sine + body.kappa * speed * speed / (gravity * piece.path_radius(body.radius))
    if square == 0.0:
        return 0.0  # at rest at the bottom
    moved: float = EPSILON * carried / (body.mass * gravity) * sine / square
    return moved


def crossings_between(run: Run, balls: list[int], since: float, until: float) -> int:
    """Return the number of junctions that some bodies cross between two times (s)."""
    events = run.events
    crossed = (events["event"] == "crossing") & np.isin(events["ball"], balls)
    return int(np.count_nonzero(crossed & (events["t"] >= since) & (events["t"] <= until)))


@SETTINGS
@given(document=scenarios())
def test_bodies_touch_at_an_impact(document: dict[str, Any]) -> None:
    assert_bodies_touch(run_of(document))


def assert_bodies_touch(run: Run) -> None:
    """Fail unless the bodies of every impact touch.

    To 8 last places of where they are, as many for each junction that they have crossed since they
    touched before, where a flight begins anew, and what the rounding of their energies moves them.

    Hit together with neighbours they touch up to the rounding by which a chain is told (on the side
    of a gap five times that), and so do they after the bounces that follow, which are timed by how
    far they go. A bounce of which one flight begins at a wall is timed by places: five times that
    rounding is not told from contact.
    """
    table = run.collisions
    radii = [abs(piece.radius) for piece in run.system.trace.pieces]
    # Energy (J) of the last impact of a body: the share left to it has the rounding of the whole.
    carried = dict.fromkeys(range(1, len(run.system.bodies) + 1), 0.0)
    apart = dict.fromkeys(carried, 0.0)
    last = dict.fromkeys(carried, 0.0)  # s: the last impact of a pair
    at_walls = run.events["event"] == "wall"
    walls = {name: run.events[name][at_walls] for name in ("t", "ball")}
    for row in range(len(table["n"])):
        places = [float(abs(table[f"{axis}_{end}"][row])) for axis in "xy" for end in "ab"]
        arcs = [radii[table[f"arc_{end}"][row] - 1] for end in "ab"]
        balls = {end: int(table[f"ball_{end}"][row]) for end in "ab"}
        size = max(*places, *arcs, 1.0)
        moved = sum(rounding_of_energy(run, row, end, carried[balls[end]]) for end in "ab")
        for ball in balls.values():
            carried[ball] = float(table["energy_a_pre"][row] + table["energy_b_pre"][row])
        since = last[balls["a"]]
        known = 1 + crossings_between(run, list(balls.values()), since, float(table["t"][row]))
        allowed = 8.0 * known * math.ulp(size) + moved
        together = np.count_nonzero(table["t"] == table["t"][row]) > 1
        pair, gap = balls["a"], float(table["gap"][row])
        most = 16.0 * EPSILON * 5.0 * size if together else apart[pair]
        deep = 16.0 * EPSILON * size if together else 0.0
        last[pair] = float(table["t"][row])
        met = (walls["t"] >= since) & (walls["t"] <= last[pair])
        if np.isin(walls["ball"][met], list(balls.values())).any():
            deep = 16.0 * EPSILON * 5.0 * size
        assert -allowed - deep <= gap <= allowed + most
        apart[pair] = gap if gap > allowed else 0.0


@SETTINGS
@given(document=scenarios())
def test_bodies_keep_their_order_and_their_distance(document: dict[str, Any]) -> None:
    run = run_of(document)
    count = len(run.system.bodies)
    end = run.summary_record()["end_time"]
    times = np.unique(np.concatenate([np.linspace(0.0, end, 400), run.collisions["t"]]))
    sample = run.sample(times)
    columns = {name: sample[name].reshape(-1, count) for name in ("s", "x", "y")}
    for a in range(count):
        for b in range(a + 1, count):
            distance = np.hypot(
                columns["x"][:, a] - columns["x"][:, b], columns["y"][:, a] - columns["y"][:, b]
            )
            reach = run.system.bodies[a].radius + run.system.bodies[b].radius
            assert np.min(distance) >= reach - 1e-13
            assert np.all(columns["s"][:, b] > columns["s"][:, a])


@SETTINGS
@given(document=scenarios())
def test_bodies_are_on_the_pieces_they_are_said_to_be_on(document: dict[str, Any]) -> None:
    run = run_of(document)
    sample = run.sample(np.linspace(0.0, run.summary_record()["end_time"], 100))
    for row in range(len(sample["t"])):
        piece = run.system.trace.pieces[int(sample["arc"][row]) - 1]
        along = float(sample["s"][row]) - piece.start_s
        assert -1e-12 <= along <= piece.length + 1e-12
        body = run.system.bodies[int(sample["ball"][row]) - 1]
        position = along if piece.is_line else piece.angle_start + along / piece.radius
        x, y = piece.body_centre(position, body.radius)
        assert math.hypot(x - sample["x"][row], y - sample["y"][row]) <= 1e-13


@SETTINGS
@given(document=scenarios())
def test_energy_goes_where_the_rows_say(document: dict[str, Any]) -> None:
    """Start less losses is what samples of the motion have, after every impact.

    The row with which lasting contact begins has the energy of all further bounces.
    """
    run = run_of(document)
    table, record = run.collisions, run.summary_record()
    count = len(run.system.bodies)
    start = record["energy_start"]
    times = np.concatenate([table["t"], [record["end_time"]]])
    kept = run.sample(times)["energy"].reshape(-1, count).sum(axis=1)
    for number, t in enumerate(times):
        happened = (table["t"] <= t) & (table["admissible"] | table["substituted"])
        lost = math.fsum(table["energy_loss"][happened])
        assert abs(start - lost - kept[number]) <= 1e-12 * max(start, 1.0)


@SETTINGS
@given(document=scenarios(k=1.0, law="normal-impulse"))
def test_energy_is_kept_without_losses(document: dict[str, Any]) -> None:
    record = run_of(document).summary_record()
    assert abs(record["energy_end"] - record["energy_start"]) <= 1e-14 * record["energy_start"]


def first_times(system: TraceSystem) -> dict[str, list[float]]:
    """Times of the first impacts, and where they happened."""
    table = simulate_system(system, TIME, 4).collisions
    return {"t": table["t"].tolist(), "s": table["s_a"].tolist()}


@FEWER
@given(document=scenarios(pieces=4, bodies=4, collisions=4))
def test_mirror_image(document: dict[str, Any]) -> None:
    run, image = run_of(document), run_of(mirrored(document))
    ours, theirs = run.collisions, image.collisions
    if not len(ours["n"]) or np.any(ours["simultaneous"]):
        reject()
    try:
        grown = amplification(run.system, first_times)
    except ArithmeticError:
        reject()  # hard by a grazing: even the number of impacts depends on the inputs' rounding
    count = len(run.system.bodies)
    rows, others = (real_impacts(table) for table in (ours, theirs))
    if len(rows) == len(ours["n"]) and len(others) == len(theirs["n"]):
        assert len(rows) == len(others)
    released = 0.0
    for row, other in zip(rows, others, strict=False):
        assert count + 1 - theirs["ball_b"][other] == ours["ball_a"][row]
        released += rounding_of_release(run, row)
        delay = 64 * EPSILON * (grown["t"][row] + released)
        assert abs(ours["t"][row] - theirs["t"][other]) <= delay
        place = run.system.trace.length - theirs["s_b"][other]
        size = max(grown["s"][row], run.system.trace.length)
        fastest = max(float(abs(ours[f"speed_{end}_pre"][: row + 1]).max()) for end in "ab")
        # Later by so much, it is also so much further on.
        moved = 64 * EPSILON * (size + fastest * released)
        moved += fastest * abs(ours["t"][row] - theirs["t"][other])
        assert abs(ours["s_a"][row] - place) <= moved


def real_impacts(table: dict[str, Any]) -> list[int]:
    """Rows of impacts that are not of rounding.

    Two bodies that a plastic impact leaves on a line touch with no speed against one another; when
    one leaves the line they may be found to meet, at an instant that the rounding of places has.
    """
    speeds = abs(table["speed_a_pre"]) + abs(table["speed_b_pre"])
    real: list[int] = np.flatnonzero(table["approach_speed"] > 1e-9 * speeds).tolist()
    return real


def rounding_of_release(run: Run, row: int) -> float:
    """Change of the time of an impact (s) for one of 1 of the places and speeds of its pair before.

    The places and speeds that an impact or the opening of a contact leaves are rounded. Beside the
    speed of parting that may be much (bodies in contact, k near 0), and no change of the start
    tells how much: the amplification does not know it.
    """
    table, events = run.collisions, run.events
    a, t = table["ball_a"][row], float(table["t"][row])
    speed = float(abs(table["speed_a_pre"][row]) + abs(table["speed_b_pre"][row]))
    mine = (events["event"] == "contact_opened") & (events["ball"] == a) & (events["t"] < t)
    opened = float(events["t"][mine].max(initial=0.0))
    before = np.flatnonzero(table["ball_a"][:row] == a)[-1:]
    parted = max(opened, float(table["t"][before].max(initial=0.0)))
    if parted == 0.0:
        return 0.0
    moved = speed * (t - parted) + float(table["s_a"][row])
    return moved / float(table["approach_speed"][row])


def _in_a_row(bodies: list[tuple[str, float]], start: float, end: float) -> dict[str, Any]:
    """Return bodies at rest at some angles in a valley, which meet at one instant."""
    trace = {
        "start_slope": start,
        "arcs": [{"shape": "valley", "radius": 1.0, "end_slope": end}],
    }
    balls = [
        {"body": body, "radius": 0.05, "mass": 1.0, "arc": 1, "speed": 0.0, "angle": angle}
        for body, angle in bodies
    ]
    document = scene(trace, balls, 0.05, "translational", time=6.0, collisions=40)
    document["collision"]["inadmissible"] = "normal-impulse"
    return document


# Two contacts close at one instant, of which one takes energy that the other does not.
CLOSING_TOGETHER = _in_a_row([("ball", -1.825), ("ball", -1.65), ("particle", -1.3875)], -2.0, 1.5)
# A contact closes while the pair beside it, which touches too, comes nearer.
HIT_AGAIN = _in_a_row([("ball", -1.91875), ("disk", -1.7125), ("ball", -1.50625)], -2.125, 2.0)


@SETTINGS
@given(document=scenarios(pieces=1, collisions=40))
@example(document=CLOSING_TOGETHER)
@example(document=HIT_AGAIN)
def test_mirror_image_on_one_arc_to_the_bit(document: dict[str, Any]) -> None:
    """Through simultaneous impacts and lasting contact, pair by pair."""
    run, image = run_of(document), run_of(mirrored(document))
    assert_mirrored_to_the_bit(run, image)
    end = min(TIME, float(run.summary_record()["end_time"]))
    angles = [state.sample([end])["angle"] for state in (run, image)]
    assert angles[0].tolist() == (-angles[1][::-1]).tolist()


def assert_mirrored_to_the_bit(run: Run, image: Run) -> None:
    """Fail unless the impacts of every pair are those of its mirror image."""
    ours, theirs = run.collisions, image.collisions
    count = len(run.system.bodies)
    for a in range(1, count):
        rows, others = ours["ball_a"] == a, theirs["ball_a"] == count - a
        for name in ("t", "t_low", "energy_loss", "approach_speed", "contact", "simultaneous"):
            assert ours[name][rows].tolist() == theirs[name][others].tolist(), name
        for name in ("angle", "speed", "energy"):
            whens = ("",) if name == "angle" else ("_pre", "_post")
            sign = 1.0 if name == "energy" else -1.0
            for end, other in ("ab", "ba"):
                for when in whens:
                    found = ours[f"{name}_{end}{when}"][rows].tolist()
                    expected = (sign * theirs[f"{name}_{other}{when}"])[others].tolist()
                    assert found == expected, (name, end, when)


def states(run: Run) -> tuple[InitialState, ...]:
    """Return the bodies at the end of a run, with reversed speeds."""
    record = run.summary_record()
    found = []
    for number in range(1, len(run.system.bodies) + 1):
        piece = run.system.trace.pieces[record[f"arc_{number}"] - 1]
        place = record[f"angle_{number}"]
        if piece.is_line:
            place = record[f"s_{number}"] - piece.start_s
        found.append(InitialState(piece.index, place, -record[f"speed_{number}"]))
    return tuple(found)


def back_home(system: TraceSystem, time: float) -> dict[str, list[float]]:
    """Return where a system is after a time."""
    record = simulate_system(system, time, None).summary_record()
    names = ("s", "speed")
    count = len(system.bodies)
    return {name: [record[f"{name}_{ball + 1}"] for ball in range(count)] for name in names}


def slightly_elsewhere(system: TraceSystem) -> Iterator[TraceSystem]:
    """The system with each place and speed of its start changed by as much, however small it is.

    The end of a run is rounded as the motion before it was, also where a body is slow at a crest.
    """
    for number, state in enumerate(system.initial):
        for start in (
            replace(state, position=state.position + CHANGE),
            replace(state, speed=state.speed + CHANGE),
        ):
            initial = (*system.initial[:number], start, *system.initial[number + 1 :])
            yield replace(system, initial=initial)


def touch_at_the_start(run: Run) -> bool:
    """Tell whether two neighbours are in contact at the start, up to rounding."""
    sample = run.sample([0.0])
    apart = np.hypot(np.diff(sample["x"]), np.diff(sample["y"]))
    radii = np.array([body.radius for body in run.system.bodies])
    return bool((apart - radii[1:] - radii[:-1] < 1e-12).any())


@FEWER
@given(document=scenarios(pieces=4, bodies=3, k=1.0, law="normal-impulse", collisions=4))
def test_time_reversal(document: dict[str, Any]) -> None:
    run = run_of(document)
    if run.end_cause == "end_of_trace" or np.any(run.collisions["simultaneous"]):
        reject()
    if touch_at_the_start(run):
        reject()  # rounding decides whether the way back ends with their impact
    # Half-way between two events, not at one of them.
    before_last = float(max(run.collisions["t"][-2:-1], default=0.0))
    time = 0.5 * (run.summary_record()["end_time"] + before_last)
    forth = simulate_system(run.system, time, None)
    reversed_start = replace(run.system, initial=states(forth))
    try:
        grown = amplification(reversed_start, lambda system: back_home(system, time))
    except ArithmeticError:
        reject()
    found = back_home(reversed_start, time)
    for other in slightly_elsewhere(reversed_start):
        for name, values in back_home(other, time).items():
            changes = (abs(a - b) / CHANGE for a, b in zip(values, found[name], strict=True))
            grown[name] = [max(pair) for pair in zip(grown[name], changes, strict=True)]
    for ball, state in enumerate(run.system.initial):
        home = run.system.trace.pieces[state.piece].arc_length(state.position)
        size = max(grown["s"][ball], run.system.trace.length)
        assert abs(found["s"][ball] - home) <= 64 * EPSILON * size
        size = max(grown["speed"][ball], 10.0)
        assert abs(found["speed"][ball] + state.speed) <= 64 * EPSILON * size


@SETTINGS
@given(document=scenarios(), share=st.floats(0.01, 0.99), engines=st.permutations(ENGINES))
def test_split_run(document: dict[str, Any], share: float, engines: list[str]) -> None:
    """Stopped at any time and taken up again by the other engine, a run has the same bits."""
    whole = run_of(document)
    part = share * float(whole.summary_record()["end_time"])
    first, second = engines
    begun = simulate_system(whole.system, part, document["stop"]["collisions"], first)
    assert begun.end_cause == "time"
    rest = simulate_system(
        whole.system, document["stop"]["time"], document["stop"]["collisions"], second,
        checkpoint=json.loads(json.dumps(begun.checkpoint())), history=begun.history(),
    )  # fmt: skip
    assert_same_results(whole, rest)


@SETTINGS
@given(document=scenarios())
def test_the_summary_tells_the_largest_gap_of_the_rows(document: dict[str, Any]) -> None:
    run = run_of(document)
    gaps = np.abs(run.collisions["gap"])
    assert run.summary_record()["max_gap"] == (gaps.max() if len(gaps) else None)
