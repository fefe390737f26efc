"""The systems there are, and what they share: the driver, the stream, the run, its columns.

Each is a folder with an object that says all that differs (see :mod:`vibro_cli.systems.contract`).
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vibro_cli.systems.contract import System

PLURALS = {"trace": "traces", "table": "tables", "springs": "springs"}
"""The systems there are, by their folders, with the word for several of a kind.

A new one is registered here, and nowhere else. The first one is meant by scenarios that name none.
"""
NAMES = tuple(PLURALS)


def system_named(name: str) -> System:
    """Return the object of a system; raises ``KeyError`` for a name that is none."""
    if name not in NAMES:
        raise KeyError(name)
    found: System = import_module(f"{__name__}.{name}").SYSTEM
    return found
