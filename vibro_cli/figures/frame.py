"""Limits, ticks, labels and titles of the panels of a portrait in the papers' coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from vibro_cli.figures import style
from vibro_cli.figures.panels import Panel
from vibro_cli.figures.ticks import (
    Ticks,
    angle_ticks,
    number_ticks,
    vertical_ticks,
    with_power,
    without_overlaps,
)
from vibro_cli.mechanics.trace import HUMP, VALLEY

_SYMBOL = {VALLEY: r"\varphi", HUMP: r"\psi"}
_TITLE_CHARACTER = 1.25
"""Mean width of a character of a title (mm)."""


def label(panels: Sequence[Panel], ball: int | str) -> None:
    """Set ticks, axis labels and titles of all panels, for a body (from 1) or several (`1,2`)."""
    for _, members in groupby(panels, key=lambda one: one.row):
        row = list(members)
        _horizontal(row, ball)
        _vertical(row, ball)
    _titles(panels)


def _horizontal(row: Sequence[Panel], ball: int | str) -> None:
    proposed = [_horizontal_ticks(one) for one in row]
    places = [(one.left, one.width, ticks) for one, ticks in zip(row, proposed, strict=True)]
    spans = [one.span for one in row]
    for one, ticks in zip(row, without_overlaps(places, spans), strict=True):
        one.axes.set_xticks(ticks.places, ticks.labels)
        symbol, unit = (_SYMBOL[one.piece.shape], "rad") if not one.piece.is_line else ("s", "m")
        one.axes.set_xlabel(rf"${symbol}_{{{ball}}}$ [{with_power(unit, ticks)}]")


def _horizontal_ticks(one: Panel) -> Ticks:
    if one.piece.is_line:
        return number_ticks(*one.span, one.width)
    return angle_ticks(*one.span, one.width)


def _vertical(row: Sequence[Panel], ball: int | str) -> None:
    for one in row:
        ticks = vertical_ticks(-one.window.top, one.window.top, one.height)
        shown = ticks.labels if one.labelled else ("",) * len(ticks.labels)
        one.axes.set_yticks(ticks.places, shown)
        if one.labelled:
            unit = "m/s" if one.piece.is_line else "rad/s"
            scaled = with_power(unit, ticks)
            one.axes.set_ylabel(f"{_rate_symbol(row, one, ball)} [{scaled}]", labelpad=1.0)


def _rate_symbol(row: Sequence[Panel], one: Panel, ball: int | str) -> str:
    """Return the symbol of a vertical axis that holds for the row's panels of the same unit."""
    if one.piece.is_line:
        return rf"$v_{{{ball}}}$"
    shapes = {other.piece.shape for other in row if not other.piece.is_line}
    symbols = [_SYMBOL[shape] for shape in (VALLEY, HUMP) if shape in shapes]
    rates = ",\\ ".join(rf"\dot{{{symbol}}}_{{{ball}}}" for symbol in symbols)
    return f"${rates}$"


def _titles(panels: Sequence[Panel]) -> None:
    """Write the titles, all in the longest form for which every panel has room."""
    forms = [[form(one) for one in panels] for form in (_full_title, _short_title, _number)]
    fitting = (
        titles
        for titles in forms
        if all(_fits(text, one) for text, one in zip(titles, panels, strict=True))
    )
    for one, text in zip(panels, next(fitting, forms[-1]), strict=True):
        one.axes.set_title(text, pad=2.0, color=style.FRAME_GREY)


def _fits(text: str, one: Panel) -> bool:
    return len(text) * _TITLE_CHARACTER <= one.width


def _full_title(one: Panel) -> str:
    if one.window.overview:
        return "whole line" if one.piece.is_line else "whole arc"
    return f"arc {one.piece.index + 1}, {one.piece.shape}"


def _short_title(one: Panel) -> str:
    return f"{one.piece.index + 1}, {one.piece.shape}"


def _number(one: Panel) -> str:
    return str(one.piece.index + 1)
