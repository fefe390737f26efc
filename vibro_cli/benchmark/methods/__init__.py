"""The methods that are measured: this solver, the papers' series, and integrators of others."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from vibro_cli.benchmark.methods.runner import Method


class _Source(NamedTuple):
    """Where methods are declared: a function of a module of this folder."""

    module: str
    function: str = "methods"
    library: str = ""
    """What has to be installed."""
    quick: bool = False
    """Whether the quick form measures them."""


_SOURCES = (
    _Source("with_vibro", quick=True),
    _Source("with_series", quick=True),
    _Source("with_heyoka", library="heyoka", quick=True),
    _Source("with_heyoka", "batches", "heyoka"),
    _Source("with_integrators", "diffrax", "diffrax"),
    _Source("with_integrators", "cyrk", "CyRK"),
    _Source("with_integrators", "scipy", quick=True),
)
PEERS = tuple(dict.fromkeys(source.library for source in _SOURCES if source.library))


def installed_peers() -> tuple[str, ...]:
    """Return the names of the peers that are installed."""
    return tuple(name for name in PEERS if find_spec(name) is not None)


def methods(quick: bool) -> list[Method]:
    """Return the methods that can be measured here.

    In the quick form few, each with the first and the second of its settings only.
    """
    found: list[Method] = []
    for source in _SOURCES:
        if (source.quick or not quick) and source.library in ("", *installed_peers()):
            module = import_module(f"vibro_cli.benchmark.methods.{source.module}")
            found += getattr(module, source.function)()
    return [one._replace(settings=one.settings[:2]) for one in found] if quick else found
