"""Common setup of all tests: signals as a terminal leaves them, and a limit for hanging tests."""

import gc
import os
import signal
from collections.abc import Iterator
from typing import Any

import hypothesis
import pytest

# Commands that tests start keep the byte code of what they import, as a user's commands do.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# How long a call or a draw takes depends on other work on the machine; and a test that has passed
# passes again with the same code, so that a failure is that of a change.
hypothesis.settings.register_profile(
    "tests",
    deadline=None,
    derandomize=True,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("tests")

_ACTIONS: dict[signal.Signals, Any] = {
    signal.SIGINT: signal.default_int_handler,
    signal.SIGHUP: signal.SIG_DFL,
    signal.SIGQUIT: signal.SIG_DFL,
}
# A signal ignored here would be ignored by every process that a test starts.
for _number, _action in _ACTIONS.items():
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _action)


def pytest_collection_finish() -> None:
    """Leave the collected tests, which stay to the end, out of every search for garbage.

    Each full search would go through all of them, a tenth of the time of the figures' tests.
    """
    gc.freeze()


class TooLong(BaseException):
    """A test has run for too long: no run may hang (not to be caught, nor shrunk)."""


def _stop(*_: object) -> None:
    raise TooLong


@pytest.fixture
def undrawn() -> Iterator[None]:
    """Make figures without rendering them, where nobody looks at them."""
    picture = b"\x89PNG"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("vibro_cli.figures.style.render", lambda *_, **__: picture)
        patch.setattr("vibro_cli.report.content.pictures_of", lambda runs, _: [[] for _ in runs])
        yield


@pytest.fixture
def no_hang() -> Iterator[None]:
    """Stop a test after two minutes of the processor (however long they are on the wall).

    Property tests in their long form, after as much more as they have more examples.
    """
    from tests.strategies import EXAMPLES  # its settings are those of the profile loaded above

    before = signal.signal(signal.SIGPROF, _stop)
    signal.setitimer(signal.ITIMER_PROF, 2.0 * max(EXAMPLES, 60))
    yield
    signal.setitimer(signal.ITIMER_PROF, 0)
    signal.signal(signal.SIGPROF, before)
