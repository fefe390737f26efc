"""Checking a folder of results against its manifest."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vibro_cli.errors import VibroError
from vibro_cli.grids.dataset import SHARD
from vibro_cli.storage.checking import Finding, check_files
from vibro_cli.storage.provenance import MANIFEST_NAME, read_manifest


class NoManifest(VibroError):
    """The folder is none of ours, or its manifest cannot be read."""


@dataclass(frozen=True)
class Verdict:
    """What a check of a folder found."""

    kind: str
    files: int
    bytes: int
    complete: bool
    missing_chunks: int
    findings: tuple[Finding, ...]

    @property
    def sound(self) -> bool:
        """Whether everything is there, and as it was written."""
        return not self.findings and self.complete


def verify(folder: Path) -> Verdict:
    """Check every file of a folder against size and SHA-256 of the manifest.

    The folders of shards that wait to be put together have manifests of their own.

    Raises
    ------
    NoManifest
        If the folder has no manifest of ours.
    OSError
        If a file cannot be read.
    """
    found = read_manifest(folder)
    if found is None:
        raise NoManifest(f"{folder} has no {MANIFEST_NAME} of vibro, or a damaged one")
    findings = list(check_files(folder, found["files"]))
    known = {*found["files"], MANIFEST_NAME}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        hidden, of_shard = path.name.startswith("."), SHARD.fullmatch(Path(name).parts[0])
        if path.is_file() and not hidden and not of_shard and name not in known:
            findings.append(Finding(name, "unknown", "not in the manifest"))
    size = sum(one["bytes"] for one in found["files"].values())
    missing = _missing_chunks(found)
    kind = str(found["schema"]).removeprefix("vibro-").partition("/")[0]
    return Verdict(kind, len(found["files"]), size, missing == 0, missing, tuple(findings))


def _missing_chunks(manifest: dict[str, Any]) -> int:
    return int(manifest["wanted"] - len(manifest["chunks"])) if "wanted" in manifest else 0
