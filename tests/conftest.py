"""Signals as a terminal leaves them, whoever started the tests (nohup, a shell's background)."""

import signal
from typing import Any

_ACTIONS: dict[signal.Signals, Any] = {
    signal.SIGINT: signal.default_int_handler,
    signal.SIGHUP: signal.SIG_DFL,
    signal.SIGQUIT: signal.SIG_DFL,
}
# What is ignored here would be ignored by every process that a test starts.
for _number, _action in _ACTIONS.items():
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _action)
