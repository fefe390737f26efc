"""The methods that are measured: this solver, the papers' series, and other integrators."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import NamedTuple

from vibro_cli.benchmark.methods import with_heyoka, with_integrators, with_series, with_vibro
from vibro_cli.benchmark.methods.runner import Method


class _Source(NamedTuple):
    """Methods with the same requirements."""

    methods: Callable[[], list[Method]]
    library: str = ""
    """Library that must be installed."""
    quick: bool = False
    """Whether the quick form measures them."""


_SOURCES = (
    _Source(with_vibro.methods, quick=True),
    _Source(with_series.methods, quick=True),
    _Source(with_heyoka.methods, "heyoka", quick=True),
    _Source(with_heyoka.batches, "heyoka"),
    _Source(with_integrators.diffrax, "diffrax"),
    _Source(with_integrators.cyrk, "CyRK"),
    _Source(with_integrators.scipy, quick=True),
)
PEERS = tuple(dict.fromkeys(source.library for source in _SOURCES if source.library))


def installed_peers() -> tuple[str, ...]:
    """Return the names of the peers that are installed."""
    return tuple(name for name in PEERS if find_spec(name) is not None)


def methods(quick: bool) -> list[Method]:
    """Return the methods that can be measured with the installed libraries.

    With `quick`, only a few are returned, each with its first two settings.
    """
    found: list[Method] = []
    for source in _SOURCES:
        if (source.quick or not quick) and source.library in ("", *installed_peers()):
            found += source.methods()
    return [one._replace(settings=one.settings[:2]) for one in found] if quick else found
