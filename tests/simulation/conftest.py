"""The compiled kernels, made once and waited for by parallel test processes."""

from __future__ import annotations

import fcntl

import pytest

from tests import references
from vibro_cli.numerics.cache import cache_folder


@pytest.fixture(scope="session")
def compiled() -> None:
    """Have machine code in the cache; several processes do not compile it at one time."""
    folder = cache_folder()
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "tests.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        references.run(references.NAMES[0], "numba")


@pytest.fixture(params=["python", "numba"])
def engine(request: pytest.FixtureRequest) -> str:
    """Each engine in turn."""
    if request.param == "numba":
        request.getfixturevalue("compiled")
    return str(request.param)
