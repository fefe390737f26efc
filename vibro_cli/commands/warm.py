"""`vibro warm`: the kernels compiled ahead of the first long run."""

import time
from functools import partial
from typing import Annotated

import typer

from vibro_cli.commands.boundary import DONE, FAILED, CommandError, say
from vibro_cli.commands.options import Task
from vibro_cli.commands.streams import json_text

# Two bodies on one arc, one impact: it calls everything that a run calls compiled.
_TINY = """
gravity = 9.81
trace = {start_slope = -1.0, arcs = [{shape = "valley", radius = 1.0, end_slope = 1.0}]}
balls = [
  {radius = 0.1, mass = 1.0, arc = 1, angle = -0.5},
  {radius = 0.1, mass = 1.0, arc = 1, angle = 0.5},
]
collision = {k = 1.0}
stop = {collisions = 1}
"""


def warm(
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the cache folder and the time it took as JSON.")
    ] = False,
) -> Task:
    """Compile the kernels now, so that no run has to wait for it."""
    return partial(_warm, as_json)


def _warm(as_json: bool) -> int:
    from vibro_cli.api import simulate
    from vibro_cli.numerics.cache import cache_folder
    from vibro_cli.numerics.machine_code import compiled
    from vibro_cli.scenario import parse_scenario
    from vibro_cli.simulation.batch import Batch
    from vibro_cli.simulation.points import run_points

    tell_of_compiling()
    begin = time.perf_counter()
    simulate(parse_scenario(_TINY, "toml"), "numba")
    Batch.compile(in_lanes=True)
    taken = time.perf_counter() - begin
    folder = cache_folder()
    if not compiled(run_points).kept:
        raise CommandError(f"vibro: the kernels cannot be kept in {folder}", FAILED)
    if as_json:
        print(json_text({"cache": str(folder), "seconds": taken}))
    say(f"the kernels are compiled and kept in {folder} ({taken:.1f} s)")
    return DONE


def tell_of_compiling() -> None:
    """Have a line said when kernels must be compiled, or are waited for."""
    from vibro_cli.numerics.cache import on_compiling

    on_compiling(lambda text: say(f"vibro: {text}"))
