"""What a robust design says of its inputs: which one is worth measuring better, and what knowing it would gain."""

from __future__ import annotations

import math

import numpy as np

from pretouch._core.blocks import Cell, Chapter, Picture, Rows
from pretouch._core.units import format_quantity, format_range

from .importance import InputImportance
from .price import Price
from .result import RobustDesign

__all__ = ["importance_section", "price_section"]


def importance_section(importance: tuple[InputImportance, ...]) -> Chapter | None:
    """Say what share of the variance each input has; nothing of fewer than two inputs: one alone has all of it."""
    found = [one for one in importance if math.isfinite(one.total)]
    if len(found) < 2:
        return None
    rows = []
    for one in found:
        shares = ((one.alone, one.alone_error), (one.total, one.total_error))
        cells = (f"{max(0.0, 100 * share):.1f} % \u00b1 {100 * error:.1f}" for share, error in shares)
        rows.append((one.name, *cells, "-" if one.by_gradient is None else f"{100 * one.by_gradient:.1f} %"))
    note = (
        "Sobol indices with their standard errors. Alone: the share of the variance of the objective that knowing this "
        "input exactly would save in the mean. With all interactions: the share that would be left if everything else "
        "were known. To first order: from the derivatives at the given values. The first input is the one to measure "
        "better."
    )
    head = ("uncertain input", "alone", "with all interactions", "to first order")
    table = Rows(head=head, rows=tuple(rows), note=note, brief=True)
    return Chapter(title="What the objective varies with", titled=True, blocks=(table,))


def price_section(design: RobustDesign) -> Chapter | None:
    """Say what knowing one input exactly would have gained, where a price is known."""
    if not design.prices:
        return None
    caption = (
        "Left: the gain that is best for each value of an input, beside the one robust gain. Right: how much worse the "
        "one gain is than the best one for that value, the other inputs at their given values."
    )
    note = (
        "The gains made for each value keep no constraints, so that part of the loss may be what constraints cost the "
        "robust gain. Inputs that were estimated together follow each other. Ranges are those that are possible, or "
        "the middle 98 %."
    )
    name = "Price of robustness over each uncertain input"
    head = ("input", "range", "best gains", "largest loss", "median loss")
    table = Rows(head=head, rows=tuple(map(_price_row, design.prices)), note=note)
    picture = Picture(figure="price", of=design, name=name, caption=caption)
    return Chapter(title="What knowing one input would gain", blocks=(picture, table))


def _price_row(price: Price) -> tuple[Cell, ...]:
    at = int(np.nanargmax(price.loss))
    best = price.best_gain[np.isfinite(price.best_gain)]
    gains = format_range((float(best.min()), float(best.max())), "N*s")
    most = f"{100 * float(price.loss[at]):.3g} % at {format_quantity(float(price.value[at]), price.unit)}"
    usual = f"{100 * float(np.nanmedian(price.loss)):.2g} %"
    return price.name, format_range((price.low, price.high), price.unit), gains, most, usual
