"""Scenes drawn at random: every run ends, in little time and memory, and obeys mechanics."""

from __future__ import annotations

from collections.abc import Callable

from vibro_cli.mechanics.system import System
from vibro_cli.simulation.run import Run, simulate_system
from vibro_cli.stress.drawing import draw
from vibro_cli.stress.finding import Document, Finding, Plan, Worst
from vibro_cli.stress.image import distance_from_image
from vibro_cli.stress.physics import Fault, faults_of
from vibro_cli.stress.scenes import system_of
from vibro_cli.stress.watched import GivenUp, Watched

CHECK = "drawn"
SECONDS = 10.0  # of the processor, for a scene, its mirror image and judging both
MEMORY = 2**30


def check(plan: Plan) -> list[Finding]:
    """Faults of the program, broken laws of mechanics, and wrong mirror images."""
    failed, broken, lopsided = Worst(), Worst(), Worst()
    judged = judge()
    for number in range(plan.scenes(40, 4000)):
        document = draw(plan.seed, number)
        kinds = {fault.kind for fault in judged(document)}
        failed.take(float("failed" in kinds), document)
        lopsided.take(float("mirror" in kinds), document)
        broken.take(float(len(kinds - {"failed", "mirror"})), document)
    tried = "scenes drawn at random, open and closed, 1 to 6 bodies, and their mirror images"
    return [
        failed.finding(CHECK, "runs that fail, or take over 10 s or 1 GB", tried, 0.0),
        broken.finding(CHECK, "laws of mechanics that a run breaks", tried, 0.0),
        lopsided.finding(CHECK, "motions that are not those of the mirror image", tried, 0.0),
    ]


def judge(seconds: float = SECONDS) -> Callable[[Document], list[Fault]]:
    """A function that tells what is wrong with the run of a document, which may not end."""
    watched = Watched(faults_of_document, MEMORY)

    def judged(document: Document) -> list[Fault]:
        try:
            return watched(document, seconds)
        except GivenUp as reason:
            return [Fault("failed", str(reason))]

    return judged


def faults_of_document(document: Document, engine: str = "compiled") -> list[Fault]:
    """What is wrong with the run of a document."""
    stop = document["stop"]

    def solve(system: System) -> Run:
        return simulate_system(system, stop.get("time"), stop.get("collisions"))

    try:
        run = solve(system_of(document))
        run.summary_record()
        faults = faults_of(run)
        if not faults:
            distance, t = distance_from_image(run, solve)
            if distance > 0.0:
                faults.append(Fault("mirror", f"{distance:.3g} m off at t = {t:.9g}"))
    except Exception as fault:
        return [Fault("failed", repr(fault))]
    return faults
