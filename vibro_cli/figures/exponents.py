"""How the Lyapunov exponents of a run converge."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from matplotlib.figure import Figure

from vibro_cli.figures import style
from vibro_cli.figures.chart import BAND, body_look, stacked, time_axis, value_axis
from vibro_cli.figures.legend import Entry
from vibro_cli.figures.source import Table

_HIGH = {"single": 46.0, "double": 56.0}
_ERRORS = 2.0
_SETTLED = 0.1
"""From this share of the run on the whole curves are shown."""


class Converging(Protocol):
    """A run that may have been asked for exponents."""

    @property
    def exponents(self) -> Table | None:
        """Columns of `exponents.parquet`; None without them."""


def exponents(run: Converging, width: str = "single") -> Figure | None:
    """Return the exponents of the run until each of its impacts, and the error of the greatest.

    None for a run that was not asked for them, or without two impacts.
    """
    table = run.exponents
    if table is None or len(table["t"]) < 2:
        return None
    t = np.asarray(table["t"], dtype=np.float64)
    names = [name for name in table if name.startswith("lyapunov_") and name != "lyapunov_error"]
    rates = [np.asarray(table[name], dtype=np.float64) for name in names]
    error = _ERRORS * np.asarray(table["lyapunov_error"], dtype=np.float64)
    look = {"color": BAND["color"], "linewidth": 4.0, "solid_capstyle": "butt"}
    band: Entry = (r"$\lambda_1\pm 2$ standard errors", look)
    entries = [
        (rf"$\lambda_{{{n}}}$", body_look(n))
        for n, rate in enumerate(rates, 1)
        if np.isfinite(rate).any()
    ]
    with style.journal():
        figure, (axes,), (across,) = stacked(width, [_HIGH[width]], entries=[*entries, band])
        axes.fill_between(t, rates[0] - error, rates[0] + error, **BAND)
        axes.axhline(0.0, color=style.FRAME_GREY, linewidth=0.4)
        for n, rate in enumerate(rates, 1):
            axes.plot(t, rate, **body_look(n))
        late = t >= t[0] + _SETTLED * (t[-1] - t[0])
        shown = np.concatenate([rate[late] for rate in rates] + [(rates[0] + error)[late]])
        shown = np.append(shown[np.isfinite(shown)], 0.0)
        value_axis(axes, float(shown.min()), float(shown.max()), _HIGH[width], r"$\lambda$", "1/s")
        time_axis(axes, float(t[-1]), across, labelled=True)
    return figure
