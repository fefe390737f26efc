"""First impacts of bodies on springs to 30 digits, in springs.json.

To make them anew: ``python -m tests.highprecision.springs_references``.
"""

from __future__ import annotations

import json
from pathlib import Path

from tests.highprecision import springs as twin
from tests.systems.springs_cases import FIGURE_FIVE, Document, disk, spring

FILE = Path(__file__).with_name("springs.json")
COLUMNS = ("t", "x_a", "x_b", "speed_a_post", "speed_b_post")

SADDLE = [
    disk(0.0, -1e-7, spring(6.0, 2.0, 1.0, 0.0)),
    disk(2.9, 0.4, spring(9.0, 2.0, 1.5, 1.6), mass=1.3),
]
"""The first passes its saddle slowly, turns at -3.5 m, and passes it again before they meet."""

CASES: dict[str, tuple[list[Document], float]] = {
    "figure 5, k = 1": (FIGURE_FIVE, 1.0),
    "figure 5, k = 0.9": (FIGURE_FIVE, 0.9),
    "one singular point each": (
        [
            disk(-1.0, 1.0, spring(5.0, 0.8, 1.0, 0.0), body="ball"),
            disk(0.5, -1.5, spring(8.0, 1.0, 1.2, 0.4), body="ball", mass=0.7),
        ],
        1.0,
    ),
    "unequal radii": (
        [
            disk(-1.0, 2.0, spring(5.0, 2.0, 1.0, 0.0), radius=0.3),
            disk(1.5, -4.0, spring(8.0, 0.5, 1.0, 0.3), radius=0.28, mass=1.5),
        ],
        1.0,
    ),
    "over a saddle at 1e-7 m/s, k = 1": (SADDLE, 1.0),
    "over a saddle at 1e-7 m/s, k = 0.9": (SADDLE, 0.9),
}


def twin_of(document: Document) -> twin.Body:
    held = document["spring"]
    kappa = {"disk": 1.5, "ball": 1.4}[document["body"]]
    spring = (held["stiffness"], held["length"], held["height"], held["foot"])
    inertia = kappa * document["mass"]
    start = document["position"], document["speed"]
    return twin.body(inertia, document["radius"], spring, *start)


def references() -> dict[str, list[list[str]]]:
    found: dict[str, list[list[str]]] = json.loads(FILE.read_text(encoding="utf-8"))
    return found


if __name__ == "__main__":
    content = {}
    for name, (balls, k) in CASES.items():
        impacts = twin.run(twin_of(balls[0]), twin_of(balls[1]), k, 10)
        content[name] = [[twin.mp.nstr(value, 30) for value in impact] for impact in impacts]
    FILE.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
