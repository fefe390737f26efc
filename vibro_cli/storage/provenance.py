"""Where a folder of results comes from: its manifest, and whether its files are as that says.

A manifest names the kind of the folder, the program and the libraries it was made with, and every
file with its size and SHA-256. Nothing of the host or of the time stands in it, so that equal
input gives an equal manifest.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from vibro_cli import __version__
from vibro_cli.errors import VibroError

MANIFEST_NAME = "manifest.json"
_MANIFEST_VERSION = "1"
_LIBRARIES = ("matplotlib", "numpy", "pyarrow", "scipy")


class FolderRefused(VibroError):
    """An existing folder must not be replaced; the message says which and why."""


def json_bytes(values: Any) -> bytes:
    """Plain values as an indented JSON file; numbers read back to the same doubles.

    Raises `ValueError` for numbers that are not finite.
    """
    return (json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def manifest(kind: str, files: Mapping[str, bytes], details: Mapping[str, Any]) -> dict[str, Any]:
    """The manifest of a folder of results.

    `kind` is what the folder holds ("run"), `files` its files' names and contents, `details` what
    else belongs to the folder's origin.
    """
    return manifest_of(kind, {name: entry(content) for name, content in files.items()}, details)


def entry(content: bytes | memoryview) -> dict[str, Any]:
    """What a manifest says of a file."""
    return {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}


def manifest_of(
    kind: str, entries: Mapping[str, Mapping[str, Any]], details: Mapping[str, Any]
) -> dict[str, Any]:
    """The manifest of a folder whose files are known by their sizes and checksums."""
    return {
        "schema": f"vibro-{kind}/{_MANIFEST_VERSION}",
        "program": {"name": "vibro", "version": __version__},
        "environment": {
            "python": platform.python_version(),
            **{name: _version(name) for name in _LIBRARIES},
        },
        **details,
        "files": dict(sorted(entries.items())),
    }


def _version(library: str) -> str:
    """The version of an installed library, without reading the whole of its description."""
    described = metadata.distribution(library).read_text("METADATA") or ""
    return described.partition("\nVersion: ")[2].partition("\n")[0]


def read_manifest(folder: Path) -> dict[str, Any] | None:
    """The manifest of a folder, or None where there is none of ours."""
    try:
        found = json.loads((folder / MANIFEST_NAME).read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(found, dict) or not isinstance(found.get("files"), dict):
        return None
    return found if str(found.get("schema")).startswith("vibro-") else None


def differences(before: Any, now: Any, path: str = "") -> list[str]:
    """Where two pieces of plain data differ, a line each: `path: before -> now`."""
    if isinstance(before, dict) and isinstance(now, dict):
        keys = [*before, *(key for key in now if key not in before)]
        return [
            line
            for key in keys
            for line in differences(
                before.get(key), now.get(key), f"{path}.{key}" if path else str(key)
            )
        ]
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        return [
            line
            for number, pair in enumerate(zip(before, now, strict=True), 1)
            for line in differences(*pair, f"{path}[{number}]")
        ]
    return [] if before == now else [f"{path}: {_short(before)} -> {_short(now)}"]


def _short(value: Any) -> str:
    text = "nothing" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:57]}..."


def check_replaceable(folder: Path, kind: str) -> None:
    """Raise `FolderRefused` unless `folder` is free, empty, or a folder of this kind of ours.

    A folder of ours into which somebody has put other files is refused too: they would be lost.
    """
    if not folder.exists():
        return
    if not folder.is_dir():
        raise FolderRefused(f"{folder} is a file; expected a folder or nothing")
    names = {entry.name for entry in folder.iterdir() if not entry.name.startswith(".")}
    if not names:
        return
    found = read_manifest(folder)
    if found is None or not found["schema"].startswith(f"vibro-{kind}/"):
        raise FolderRefused(
            f"{folder} exists and is no vibro {kind}; it is left as it is (choose another with -o)"
        )
    foreign = sorted(names - set(found["files"]) - {MANIFEST_NAME})
    if foreign:
        raise FolderRefused(
            f"{folder} holds {foreign[0]}, which vibro did not write; it is left as it is "
            "(move that file, or choose another folder with -o)"
        )


@dataclass(frozen=True)
class Finding:
    """One file that is not as it was written."""

    file: str
    state: str
    """missing, damaged or unknown."""
    detail: str

    def __str__(self) -> str:
        what = "missing" if self.state == "missing" else f"not as it was written ({self.detail})"
        return f"{self.file} is {what}"


def check_files(folder: Path, described: Mapping[str, Mapping[str, Any]]) -> Iterator[Finding]:
    """Every file that is missing or not as it was written.

    `described` has what the manifest says of each: its `bytes` and its `sha256`. Raises `OSError`
    when a file cannot be read.
    """
    for name, wanted in described.items():
        finding = _check(folder, name, wanted)
        if finding is not None:
            yield finding


def _check(folder: Path, name: str, described: Mapping[str, Any]) -> Finding | None:
    path = folder / name
    try:
        size = path.stat().st_size
    except FileNotFoundError:
        return Finding(name, "missing", "not there")
    if size != described["bytes"]:
        return Finding(name, "damaged", f"{size} bytes, expected {described['bytes']}")
    with open(path, "rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    if found != described["sha256"]:
        detail = f"SHA-256 {found[:12]}…, expected {described['sha256'][:12]}…"
        return Finding(name, "damaged", detail)
    return None


def available_cores() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):  # Linux
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
