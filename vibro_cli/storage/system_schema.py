"""The tables of the systems other than the trace, said as in `storage.schema`."""

from collections.abc import Iterator, Sequence

from vibro_cli.storage.schema import Column, Table, count, flag, number

_AXES = ("x", "y")
_LAW = Column("law", "string", "", "impact law that gave the speeds after the impact")


def system_table(system: str, name: str, column_names: Sequence[str]) -> Table:
    """The table `name` of a system, as it must be for data with these columns.

    Raises `ValueError` for a name that is no table.
    """
    if name == "summary":
        return system_summary(system, sum(column.startswith("x_") for column in column_names))
    for table in system_reference(system):
        if table.file == name:
            return table
    raise ValueError(f"there is no table {name!r}")


def system_summary(system: str, balls: int) -> Table:
    """The table of summaries of runs of a system with `balls` bodies."""
    return _SUMMARIES[system](*range(1, balls + 1))


def system_reference(system: str) -> tuple[Table, ...]:
    """Every table of a system; the final state stands for any body `i`."""
    if system == "table":
        return (_impacts(), _bounces(), _motion(), _summary("i"))
    return (_springs_impacts(), _springs_events(), _springs_motion(), _springs_summary("i"))


def _head() -> Iterator[Column]:
    yield count("n", "number of the impact, from 1")
    yield number("t", "s", "time of the impact, the nearest double")
    yield number("t_low", "s", "what t lacks: t + t_low is the time in two doubles")
    yield number("dt", "s", "time since the previous row (null in the first)", nullable=True)


def _impacts() -> Table:
    columns = [*_head(), count("ball_a", "one ball, from 1"), count("ball_b", "the other, from 1")]
    for ball in ("a", "b"):
        for axis in _AXES:
            columns.append(number(f"{axis}_{ball}", "m", f"place of the centre of ball {ball}"))
    text = "direction from the centre of ball a to that of ball b, from the x axis"
    columns.append(number("normal_angle", "rad", text))
    for when, words in (("pre", "before"), ("post", "after")):
        for ball in ("a", "b"):
            for axis in _AXES:
                text = f"component of the velocity of ball {ball} {words} the impact"
                columns.append(number(f"velocity_{axis}_{ball}_{when}", "m/s", text))
    for when, words in (("pre", "before"), ("post", "after")):
        for ball in ("a", "b"):
            text = f"component along the line of centres of ball {ball}, {words} the impact"
            columns.append(number(f"normal_speed_{ball}_{when}", "m/s", text))
    for ball in ("a", "b"):
        text = f"component of ball {ball} across the line of centres, which stays"
        columns.append(number(f"tangential_speed_{ball}", "m/s", text))
    for when, words in (("pre", "before"), ("post", "after")):
        for ball in ("a", "b"):
            text = f"kinetic energy of ball {ball} {words} the impact"
            columns.append(number(f"energy_{ball}_{when}", "J", text))
    columns += _tail()
    return Table("table.collisions", "one impact of two balls", tuple(columns))


def _tail() -> Iterator[Column]:
    """What every impact of two bodies ends with."""
    yield number("energy_loss", "J", "energy lost in the impact")
    yield number("impulse_moment", "N m s", "J_Pb (ω_b⁺ − ω_b⁻), the moment of the impulse")
    yield number("approach_speed", "m/s", "speed of approach along the line of centres, before")
    yield number("separation_speed", "m/s", "speed of separation along the line of centres, after")
    yield number("gap", "m", "horizontal distance of the centres beyond that of touching")
    yield _LAW
    yield flag("admissible", "whether the bodies separate after the law of the scenario")
    text = "whether the normal-impulse law stood in for an inadmissible impact"
    yield flag("substituted", text)
    text = "whether the event before it was at the same instant, or others are solved with it"
    yield flag("simultaneous", text)
    text = "whether the contact cannot be told from a touch in double precision"
    yield flag("grazing", text)


def _bounces() -> Table:
    columns = [
        *_head(),
        count("ball", "the ball, from 1"),
        count("edge", "side of the polygon or rectangle, from 1 (null on a curve)", nullable=True),
        number("x", "m", "place of the centre"),
        number("y", "m", "place of the centre"),
        number("normal_angle", "rad", "direction from the centre to the wall, from the x axis"),
    ]
    for when, words in (("pre", "before"), ("post", "after")):
        for axis in _AXES:
            text = f"component of the velocity {words} the impact"
            columns.append(number(f"velocity_{axis}_{when}", "m/s", text))
    columns += [
        number("normal_speed_pre", "m/s", "component towards the wall before the impact"),
        number("normal_speed_post", "m/s", "component towards the wall after the impact"),
        number("tangential_speed", "m/s", "component along the wall, which stays"),
        number("energy_loss", "J", "energy lost in the impact"),
        flag("grazing", "whether the contact cannot be told from a touch in double precision"),
    ]
    return Table("table.bounces", "one impact of a ball on the wall", tuple(columns))


def _motion() -> Table:
    columns = (
        number("t", "s", "time"),
        count("ball", "ball, from 1"),
        number("x", "m", "place of the centre"),
        number("y", "m", "place of the centre"),
        number("velocity_x", "m/s", "component of the velocity of the centre"),
        number("velocity_y", "m/s", "component of the velocity of the centre"),
        number("speed", "m/s", "speed of the centre"),
        number("energy", "J", "kinetic energy"),
    )
    return Table("table.motion", "one ball at one sampled time", columns)


def _summary(*balls: int | str) -> Table:
    causes = (
        "time, collisions, bounces, no_more_collisions, inadmissible, wall_contact (a ball comes "
        "to roll along the wall, which is not solved) or accumulation (impacts without end in "
        "finite time, which are not solved)"
    )
    columns = [
        *_ending(causes),
        count("collisions", "number of impacts of two balls", True),
        count("bounces", "number of impacts on the wall", True),
        *_balance(),
    ]
    for ball in balls:
        for axis in _AXES:
            columns.append(number(f"{axis}_{ball}", "m", f"final place of ball {ball}", True))
        for axis in _AXES:
            text = f"final component of the velocity of ball {ball}"
            columns.append(number(f"velocity_{axis}_{ball}", "m/s", text, True))
    return Table("table.summary", "one run", tuple(columns))


def _ending(causes: str) -> Iterator[Column]:
    """What every summary begins with."""
    yield Column("status", "string", "", "ok, invalid (the scenario is not possible) or failed")
    yield Column("reason", "string", "", "why the status is not ok", nullable=True)
    yield Column("end_cause", "string", "", causes, nullable=True)
    yield number("end_time", "s", "time at which the run ended", True)


def _balance() -> Iterator[Column]:
    """Times, energies and gaps of every summary."""
    yield number("first_collision_time", "s", "time of the first impact of two bodies", True)
    yield number("last_collision_time", "s", "time of the last impact of two bodies", True)
    yield number("energy_start", "J", "energy of all bodies at the start", True)
    yield number("energy_end", "J", "energy of all bodies at the end", True)
    yield number("energy_drift", "", "relative change of the energy, where it should be kept", True)
    text = "sum of the corrections that keep the energy, absolute"
    yield number("energy_correction", "J", text, True)
    yield number("max_gap", "m", "largest distance left between bodies at an impact", True)


_ENERGY = "kinetic energy and energy of the spring"
_DISPLACEMENT = "place of the centre from that of its spring's foot"


def _springs_impacts() -> Table:
    columns = [*_head(), count("ball_a", "left body, from 1"), count("ball_b", "right body")]
    for text, name, unit in (
        ("place of the centre along the line", "x", "m"),
        (_DISPLACEMENT, "displacement", "m"),
    ):
        columns += [number(f"{name}_{ball}", unit, f"{text}, of body {ball}") for ball in "ab"]
    for text, name, unit in (
        ("angular velocity of rolling", "omega", "rad/s"),
        ("signed speed of the centre", "speed", "m/s"),
        (_ENERGY, "energy", "J"),
    ):
        for when, words in (("pre", "before"), ("post", "after")):
            for ball in "ab":
                what = f"{text}, {words} the impact, of body {ball}"
                columns.append(number(f"{name}_{ball}_{when}", unit, what))
    columns += [*_tail(), flag("contact", "whether lasting contact of the pair begins here")]
    return Table("springs.collisions", "one impact of two neighbours", tuple(columns))


def _springs_events() -> Table:
    columns = (
        number("t", "s", "time of the event"),
        Column("event", "string", "", "contact_closed or contact_opened"),
        count("ball", "left body of the pair, from 1"),
        count("other", "right body of the pair"),
        number("speed", "m/s", "speed of the left body after the event"),
        number("value", "s", "contact_closed: how long the bounces left out would last", True),
    )
    return Table("springs.events", "one beginning or end of a lasting contact", columns)


def _springs_motion() -> Table:
    columns = (
        number("t", "s", "time"),
        count("ball", "body, from 1"),
        number("x", "m", "place of the centre along the line"),
        number("displacement", "m", _DISPLACEMENT),
        number("speed", "m/s", "signed speed of the centre"),
        number("energy", "J", _ENERGY),
    )
    return Table("springs.motion", "one body at one sampled time", columns)


def _springs_summary(*balls: int | str) -> Table:
    columns = [
        *_ending("time, collisions, no_more_collisions or inadmissible"),
        count("collisions", "number of impacts", True),
        count("contacts", "number of lasting contacts begun", True),
        *_balance(),
    ]
    for ball in balls:
        columns.append(number(f"x_{ball}", "m", f"final place of body {ball}", True))
        text = f"the same of body {ball} from its spring's foot"
        columns.append(number(f"displacement_{ball}", "m", text, True))
        columns.append(number(f"speed_{ball}", "m/s", f"final speed of body {ball}", True))
    return Table("springs.summary", "one run", tuple(columns))


_SUMMARIES = {"table": _summary, "springs": _springs_summary}
