"""Both engines, for tests that are to give the same with either."""

from __future__ import annotations

import pytest


@pytest.fixture(params=["python", "compiled"])
def engine(request: pytest.FixtureRequest) -> str:
    """Each engine in turn."""
    return str(request.param)
