"""Basins: the outcome of each start of a grid, and measures of how finely outcomes are mixed.

Basin entropy: A. Daza, A. Wagemakers, B. Georgeot, D. Guéry-Odelin, M. A. F. Sanjuán, "Basin
entropy: a new tool to analyze uncertainty in dynamical systems", *Scientific Reports* 6 (2016)
31416. Uncertainty exponent: S. W. McDonald, C. Grebogi, E. Ott, J. A. Yorke, "Fractal basin
boundaries", *Physica D* 17 (1985) 125-153.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibro_cli.errors import VibroError
from vibro_cli.numerics.elementwise import Floats

Codes = NDArray[np.int64]

BOX = 5
"""Cells along an edge of the boxes of the basin entropy, as in its source."""
FEWEST = 32
"""Least number of values of an axis, which allows three distances with ratios of 2."""


class NoBasins(VibroError, ValueError):
    """The basins of a grid cannot be determined; the message says why."""


@dataclass(frozen=True)
class Outcomes:
    """Outcomes of points."""

    names: tuple[str, ...]
    """Outcomes in words, the most frequent first."""
    code: Codes
    """Index of each point's outcome."""


@dataclass(frozen=True)
class Estimate:
    """A number with its standard error."""

    value: float
    error: float | None
    """Standard error; None for a single box."""

    def __str__(self) -> str:
        """Return the number with four decimals, and its error if known."""
        error = "" if self.error is None else f" ± {self.error:.4f}"
        return f"{self.value:.4f}{error}"


@dataclass(frozen=True)
class Basins:
    """Measures of how finely the outcomes of a grid over one or two axes are mixed."""

    outcomes: tuple[str, ...]
    """Outcomes in words, the most frequent first."""
    shares: Floats
    """Fraction of the points, by outcome."""
    cells: Codes
    """Index of the outcome of each cell; the last axis is the first of the lattice."""
    entropy: Estimate
    """Basin entropy (nats): the mean of ``-sum p ln p`` over boxes of 5 cells a side."""
    boundary_entropy: Estimate | None
    """Mean over boxes with more than one outcome; above ln 2 it suggests a fractal boundary."""
    distances: Floats
    """Distances in cells."""
    uncertain: Floats
    """Fraction of cells with a different outcome within each distance, diagonals included."""
    exponent: Estimate | None
    """Uncertainty exponent: the fraction grows as this power of the distance; 1 if smooth."""

    @property
    def fractal(self) -> bool:
        """Whether the boundary basin entropy exceeds ln 2 by two errors (fractal boundary)."""
        one = self.boundary_entropy
        if one is None or one.error is None:
            return False
        return one.value - 2.0 * one.error > float(np.log(2.0))

    @property
    def boundary_dimension(self) -> float | None:
        """Box-counting dimension of the boundaries: number of axes minus the exponent."""
        return None if self.exponent is None else self.cells.ndim - self.exponent.value


def outcomes_of(summary: Mapping[str, Any], names: Sequence[str], rows: Codes) -> Outcomes:
    """Return the outcomes of rows of a summary: combinations of values of the named columns.

    Raises `NoBasins` for an unknown column, and for one with non-integer numbers or without values.
    """
    if not names:
        raise NoBasins("expected at least one column that states an outcome")
    results = list(summary)[list(summary).index("status") :]
    for name in names:
        if name not in results or not _is_outcome(summary[name]):
            known = ", ".join(one for one in results if _is_outcome(summary[one]))
            raise NoBasins(f"found the outcome {name!r}, expected one of {known}")
    columns = [np.asarray(summary[name])[rows] for name in names]
    # Compose words once per combination of values.
    combination = combined([codes_of(values) for values in columns])
    first = np.unique(combination, return_index=True)[1]
    texts = [_texts(name, values[first]) for name, values in zip(names, columns, strict=True)]
    joined = np.array([", ".join(filter(None, row)) for row in zip(*texts, strict=True)])
    words, same = np.unique(joined, return_inverse=True)
    code = same[combination]
    order = np.argsort(-np.bincount(code, minlength=len(words)), kind="stable")
    return Outcomes(tuple(map(str, words[order])), np.argsort(order)[code])


def codes_of(values: NDArray[Any]) -> Codes:
    """Return integer codes, from 0, of the distinct values of a column."""
    if values.dtype != object:
        return np.unique(values, return_inverse=True)[1]
    known: dict[Any, int] = {}
    return np.array([known.setdefault(one, len(known)) for one in values.tolist()], dtype=np.int64)


def combined(columns: Sequence[Codes]) -> Codes:
    """Return integer codes, from 0, of the distinct combinations of the codes of columns."""
    found = np.zeros_like(columns[0])
    for code in columns:
        pair = found * (code.max(initial=0) + 1) + code
        found = np.unique(pair, return_inverse=True)[1]
    return found


def _is_outcome(column: Any) -> bool:
    values = np.asarray(column)
    if values.dtype == object:
        return any(one is not None for one in values)
    finite = values[np.isfinite(values)]
    return bool(finite.size and np.all(finite == np.rint(finite)))


def _texts(name: str, values: NDArray[Any]) -> list[str]:
    """Return values in words, numbers with the column's name; a missing value is empty."""
    if values.dtype == object:
        return ["" if one is None else str(one).replace("_", " ") for one in values]
    what, _, body = name.rpartition("_")
    words = f"{body} on arc" if what == "arc" else name.replace("_", " ")
    return [f"{words} {one:.0f}" if np.isfinite(one) else "" for one in values]


def basins_of(outcomes: Outcomes, cells: Codes) -> Basins:
    """Return the measures of outcomes over evenly spaced values of one or two axes.

    `cells` has the index of the outcome of each cell; an axis needs at least `FEWEST` values.
    """
    number = len(outcomes.names)
    shares = np.bincount(cells.ravel(), minlength=number) / cells.size
    entropies = _entropies(cells, number)
    mixed = entropies[entropies > 0.0]
    distances = 2 ** np.arange(int(np.log2(min(cells.shape) // 8)) + 1)
    uncertain = np.array([_uncertain(cells, int(step)) for step in distances])
    return Basins(
        outcomes.names,
        shares,
        cells,
        _mean(entropies),
        _mean(mixed) if len(mixed) else None,
        distances.astype(np.float64),
        uncertain,
        _slope(np.log(distances), np.log(uncertain)) if np.all(uncertain > 0.0) else None,
    )


def _entropies(cells: Codes, number: int) -> Floats:
    """Return the entropy of each box, without incomplete boxes at the far edges."""
    whole = tuple(slice(0, size - size % BOX) for size in cells.shape)
    boxed = cells[whole]
    counts = np.stack([_in_boxes(boxed == code) for code in range(number)])
    share = counts / BOX**cells.ndim
    terms = np.where(share > 0.0, share * np.log(np.where(share > 0.0, share, 1.0)), 0.0)
    entropies: Floats = np.abs(terms.sum(axis=0)).ravel()
    return entropies


def _in_boxes(which: NDArray[np.bool_]) -> NDArray[np.int64]:
    shape = [part for size in which.shape for part in (size // BOX, BOX)]
    counts: NDArray[np.int64] = which.reshape(shape).sum(axis=tuple(range(1, len(shape), 2)))
    return counts


def _uncertain(cells: Codes, reach: int) -> float:
    """Return the fraction of cells with a different outcome at most `reach` cells away."""
    # Imported here: it takes 0.2 s, and the figures of every run import this module.
    from scipy.ndimage import maximum_filter, minimum_filter

    inner = tuple(slice(reach, size - reach) for size in cells.shape)
    window = 2 * reach + 1
    differs = maximum_filter(cells, window) != minimum_filter(cells, window)
    return float(differs[inner].mean())


def _mean(values: Floats) -> Estimate:
    spread = float(values.std(ddof=1)) / len(values) ** 0.5 if len(values) > 1 else None
    return Estimate(float(values.mean()), spread)


def _slope(x: Floats, y: Floats) -> Estimate:
    """Return the slope of the regression line through points, and its standard error."""
    around = x - x.mean()
    slope = float(around @ y / (around @ around))
    residual = y - y.mean() - slope * around
    return Estimate(slope, float((residual @ residual / (len(x) - 2) / (around @ around)) ** 0.5))
