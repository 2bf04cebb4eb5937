"""Build the report on a comparison of candidates, such as several sensors."""

from __future__ import annotations

import math
from typing import Final

from pretouch._core.blocks import Cell, Listing, Measured, Page, PageTable, Picture

from .candidates import Candidate, CandidateComparison

_HEAD: Final = ("candidate", "verdict", "gain", "contact", "95 % below", "excursion", "margin", "rate", "latency")
_HOW: Final = (
    "Each circle is one candidate: its mean largest excursion and its mean speed at contact over the simulated runs. "
    "The bar ends at the speed that 95 % of the runs stay below. Lower left is better."
)
_NOTE: Final = (
    "Each candidate runs with its own gain. Contact: mean speed over the simulated runs. Excursion: mean of the "
    "largest retreat. Margin: factor by which the gain may grow before the loop is unstable."
)


def candidates_page(comparison: CandidateComparison) -> Page:
    """Return the report page of a comparison of candidates."""
    reasons = tuple((c.name, c.reason[:1].upper() + c.reason[1:]) for c in comparison.candidates if c.reason)
    refused = tuple(f"{c.name} was not verified: {c.problem}" for c in comparison.candidates if c.problem)
    drawn = any(math.isfinite(c.contact_speed) for c in comparison.candidates)
    picture = Picture(
        figure="candidates",
        of=comparison,
        name="Mean speed at contact of each candidate over its mean largest excursion",
        caption=_HOW,
    )
    return Page(
        kind="Which one is best?",
        headline=comparison.headline,
        status="one holds" if comparison.best else "none holds",
        good=comparison.best is not None,
        warnings=comparison.warnings,
        lead="candidates",
        blocks=(
            picture if drawn else None,
            PageTable(head=_HEAD, rows=tuple(map(_row, comparison.candidates)), note=_NOTE, brief=True),
            Listing(items=(*refused, *comparison.notes), brief=True) if refused or comparison.notes else None,
            PageTable(head=("candidate", "main reason"), rows=reasons, wraps=True) if reasons else None,
        ),
    )


def _row(candidate: Candidate) -> tuple[Cell, ...]:
    """Return the table row of one candidate."""
    v = candidate.verdict
    speed, high = candidate.contact_speed, candidate.high_contact_speed
    margin = candidate.gain_margin
    return (
        candidate.name,
        candidate.status.value.replace("-", " "),
        "-" if v is None or v.gain is None else Measured(v.gain, v.law.number.unit, 3),
        Measured(speed, "m/s", 3),
        Measured(high, "m/s", 3),
        Measured(candidate.mean_of("largest_excursion"), "m", 3),
        "stable" if math.isinf(margin) else Measured(margin, "", 3),
        "-" if v is None else Measured(v.loop.chain.rate, "Hz", 3),
        "-" if v is None else Measured(v.loop.chain.latency, "s", 2),
    )
