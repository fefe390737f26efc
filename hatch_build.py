"""The build hook: the library of kernels is made when the package is installed or packed."""

from __future__ import annotations

import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ROOT = Path(__file__).parent
sys.path.insert(0, str(ROOT))

from vibro_cli.compile.build import ZIG, build, portable_levels, system_compiler  # noqa: E402
from vibro_cli.compile.native import FOLDER  # noqa: E402


class KernelsHook(BuildHookInterface[Any]):
    """Makes the library: for this machine if editable, in a wheel for all of its kind."""

    def dependencies(self) -> list[str]:
        """Return the compiler that comes as a wheel, where the system has none."""
        return [] if system_compiler() else [f"{ZIG}>=0.13"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Make the library and have it packed, with the tag of the platform."""
        if self.target_name != "wheel":
            return
        from vibro_cli.programs import programs

        if version == "editable":
            build(programs())
            return
        self._made = tempfile.TemporaryDirectory()
        build(programs(), Path(self._made.name), portable_levels())
        inside = FOLDER.relative_to(ROOT).as_posix()
        build_data["force_include"] = {
            str(path): f"{inside}/{path.name}" for path in Path(self._made.name).iterdir()
        }
        build_data["pure_python"] = False
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["tag"] = f"py3-none-{platform}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove what was made outside of the source tree."""
        if hasattr(self, "_made"):
            self._made.cleanup()
