"""The systems, and what they share: driver, streaming, runs, columns of tables.

Each system is a folder with one object for all that differs, see
:mod:`vibro_cli.systems.contract`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vibro_cli.systems.contract import System

PLURALS = {"trace": "traces", "table": "tables", "springs": "springs"}
"""Plural of each system, by the name of its folder.

A new system is registered here, and nowhere else. Scenarios that name none have the first one.
"""
NAMES = tuple(PLURALS)


def system_named(name: str) -> System:
    """Return the object of a system; raises ``KeyError`` for an unknown name."""
    if name not in NAMES:
        raise KeyError(name)
    found: System = import_module(f"{__name__}.{name}").SYSTEM
    return found
