"""The machine and the versions a benchmark was made with."""

from __future__ import annotations

import os
import platform
from importlib import metadata
from pathlib import Path

from vibro_cli import __version__
from vibro_cli.grids.threads import available_cores

_LIBRARIES = ("numpy", "scipy", "heyoka", "diffrax", "jax", "CyRK")


def describe() -> dict[str, str]:
    """Return processor, cores, system and versions, as words."""
    found = {
        "Processor": _processor(),
        "Cores that may be used": str(available_cores()),
        "Load when it began (1, 5, 15 minutes)": ", ".join(f"{v:.1f}" for v in os.getloadavg()),
        "System": f"{platform.system()} {platform.release()} {platform.machine()}",
        "Python": platform.python_version(),
        "vibro": __version__,
    }
    for name in _LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown"
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else "unknown"
