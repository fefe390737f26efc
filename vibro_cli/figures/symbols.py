"""What an axis says of a column of a table: its symbol, or its words."""

from __future__ import annotations

import re

_SIDES = {"pre": " before", "post": " after"}
_SYMBOLS = {
    "t": "t",
    "dt": r"\Delta t",
    "s": "s",
    "x": "x",
    "y": "y",
    "speed": "v",
    "velocity_x": "v_x",
    "velocity_y": "v_y",
    "normal_speed": r"v_\mathrm{n}",
    "tangential_speed": r"v_\mathrm{t}",
    "omega": r"\omega",
    "energy": "E",
    "kinetic_energy": r"E_\mathrm{k}",
    "lyapunov": r"\lambda",
}
_NAME = re.compile(r"(?P<stem>.+?)(?:_(?P<body>[ab]|[0-9]+))?(?:_(?P<side>pre|post))?")


def symbol_of(column: str) -> str:
    """Return how an axis names a column: `speed_a_pre` is v_a before, in the letters of formulas.

    Columns without a letter of their own are named by their words: `angle_a` is the angle of a.
    """
    found = _NAME.fullmatch(column)
    assert found is not None, column
    stem, body = found["stem"], found["body"] or ""
    side = _SIDES.get(found["side"] or "", "")
    symbol = _SYMBOLS.get(stem)
    if symbol is None:
        of = f" of {body}" if body.isalpha() else f" {body}".rstrip()
        return f"{stem.replace('_', ' ')}{of}{side}"
    letter, _, index = symbol.partition("_")
    below = ",".join(part for part in (index, body) if part)
    return f"${letter}_{{{below}}}${side}" if below else f"${letter}${side}"
