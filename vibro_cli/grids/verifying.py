"""Checking a folder of results against its manifest."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vibro_cli.storage.provenance import MANIFEST_NAME, read_manifest

_AT_ONCE = 1 << 20


class NoManifest(Exception):
    """The folder is none of ours, or its manifest cannot be read."""


@dataclass(frozen=True)
class Finding:
    """One file that is not as it was written."""

    file: str
    state: str
    """missing, damaged or unknown."""
    detail: str


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
    findings = []
    for name, described in found["files"].items():
        finding = _check(folder, name, described)
        if finding is not None:
            findings.append(finding)
    known = {*found["files"], MANIFEST_NAME}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_file() and not path.name.startswith(".") and name not in known:
            findings.append(Finding(name, "unknown", "not in the manifest"))
    size = sum(one["bytes"] for one in found["files"].values())
    missing = _missing_chunks(found)
    kind = str(found["schema"]).removeprefix("vibro-").partition("/")[0]
    return Verdict(kind, len(found["files"]), size, missing == 0, missing, tuple(findings))


def _missing_chunks(manifest: dict[str, Any]) -> int:
    return int(manifest["wanted"] - len(manifest["chunks"])) if "wanted" in manifest else 0


def _check(folder: Path, name: str, described: dict[str, Any]) -> Finding | None:
    path = folder / name
    try:
        size = path.stat().st_size
    except FileNotFoundError:
        return Finding(name, "missing", "not there")
    if size != described["bytes"]:
        return Finding(name, "damaged", f"{size} bytes, expected {described['bytes']}")
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(_AT_ONCE):
            digest.update(block)
    if digest.hexdigest() != described["sha256"]:
        return Finding(
            name,
            "damaged",
            f"SHA-256 {digest.hexdigest()[:12]}…, expected {described['sha256'][:12]}…",
        )
    return None
