"""Both engines, for tests in which either has to give the same result."""

from __future__ import annotations

import pytest


@pytest.fixture(params=["python", "compiled"])
def engine(request: pytest.FixtureRequest) -> str:
    """Each engine in turn."""
    return str(request.param)
