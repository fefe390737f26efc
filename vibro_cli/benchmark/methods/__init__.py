"""The methods that are measured: this solver, the papers' series, and other integrators."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

from vibro_cli.benchmark.methods import with_heyoka, with_integrators, with_series, with_vibro
from vibro_cli.benchmark.methods.runner import Method

# Functions that return methods, the library that these need, and whether the quick form has them.
_SOURCES: tuple[tuple[Callable[[], list[Method]], str, bool], ...] = (
    (with_vibro.methods, "", True),
    (with_series.methods, "", True),
    (with_heyoka.methods, "heyoka", True),
    (with_heyoka.batches, "heyoka", False),
    (with_integrators.diffrax, "diffrax", False),
    (with_integrators.cyrk, "CyRK", False),
    (with_integrators.scipy, "", True),
)
PEERS = tuple(dict.fromkeys(library for _, library, _ in _SOURCES if library))


def installed_peers() -> tuple[str, ...]:
    """Return the names of the peers that are installed."""
    return tuple(name for name in PEERS if find_spec(name) is not None)


def methods(quick: bool) -> list[Method]:
    """Return the methods that can be measured with the installed libraries.

    With `quick`, only a few are returned, each with its first two settings.
    """
    found: list[Method] = []
    for made, library, in_quick_form in _SOURCES:
        if (in_quick_form or not quick) and library in ("", *installed_peers()):
            found += made()
    return [one._replace(settings=one.settings[:2]) for one in found] if quick else found
