"""Which kernels solve a system: those of a rotating trace, if it rotates."""

from __future__ import annotations

from vibro_cli.compile.kernel import Overrides
from vibro_cli.kernels.rotating import TURNING
from vibro_cli.mechanics.system import System


def overrides_of(system: System) -> Overrides | None:
    """Return the overrides of the kernels for a system; None for a trace at rest."""
    return TURNING if system.turning else None
