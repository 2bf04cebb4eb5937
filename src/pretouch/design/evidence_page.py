"""Why a design is believed, and what moves it: the last tables of its page."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from pretouch._core.blocks import Cell, Chapter, Measured, Paragraph, Picture, Rows
from pretouch._core.units import format_range, pretty_unit
from pretouch.motion import LawNumber
from pretouch.motion.page_sections import solved_on

from .certificate import IdealDesign
from .gain import GainDesign

Row = tuple[Cell, ...]

_HELD: Final = "No input moves the optimal gain: what holds it does not depend on them."
_AT: Final = {
    "interior": "inside the bounds, where the objective is stationary",
    "bound": "on a bound of the gain: a wider range may hold a better one",
    "edge of contact": "where contact is just still made",
    "corner": "inside the bounds, where the objective has a corner or a jump: no derivative holds there",
}


def evidence_section(design: GainDesign) -> Chapter:
    """Return why a design is believed."""
    known = design.certificate
    note = "The scan covers the whole range, so the optimum does not depend on a starting point."
    if solved_on(design) != "loop":
        note += " The impulse balance is an identity of L(1) and L(2) for every sensor curve: it certifies the motion."
    found = Rows(rows=tuple(_certificate_rows(design)), wraps=True, brief=known is not None, note=note)
    minima = () if known is None or len(known.local_minima) < 2 else known.local_minima
    others = Rows(
        head=(f"local minimum at {design.number.symbol}", "objective"),
        rows=tuple((Measured(gain, design.number.unit), Measured(value, "", 5)) for gain, value in minima),
    )
    return Chapter(title="How this is known", titled=True, blocks=(found, others if minima else None))


def _certificate_rows(design: GainDesign) -> Iterator[Row]:
    known = design.certificate
    yield "searched", f"every gain from {format_range(design.bounds, design.number.unit)}"
    if known is None:
        yield "scan", f"{len(design.trade_off.gain)} gains"
    else:
        text = f"{known.scanned} gains; neighbors predict each to {known.resolution:.1e} of the objective's range"
        yield "scan", text
        yield "local minima found and refined", str(len(known.local_minima))
        yield "the optimum lies", _AT.get(known.at, f"on the limit of the constraint {known.at.replace('_', ' ')}")
        low, high = (design.number.text(b, 8) for b in sorted(known.bracket))
        yield "enclosed between", f"{low} and {high}"
        if known.stationarity is not None:
            yield f"first-order residual |df / d ln|{design.number.symbol}|| / f", f"{known.stationarity:.1e}"
    if design.ideal is not None:
        yield "ideal design, in continuous time", ideal_in_words(design.ideal, design.number)
    run = design.result or design.nearest
    if solved_on(design) == "loop":
        yield "motion", "sampled loop, run with every gain"
    if run is not None and solved_on(design) != "loop":
        residual = float(np.asarray(run.impulse_residual))
        missing = "not defined for the uniform motion" if run.method == "uniform-motion" else "not known"
        text = missing if math.isnan(residual) else f"met to {residual:.1e} of its largest term"
        yield f"impulse balance of the motion ({run.method})", text


def ideal_in_words(ideal: IdealDesign, number: LawNumber) -> str:
    """Say what the ideal gain comes to where another was designed, as in `-0.7463 N s, which here is 24 % worse`."""
    text = f"{number.text(ideal.gain)}, which here "
    if not math.isfinite(ideal.objective):
        return text + "ends without contact"
    share = abs(100 * ideal.loss)
    text += f"is {share:.0f} % " if share >= 100 else f"is {share:.2g} % "
    text += "worse" if ideal.loss >= 0 else "better"
    return text if ideal.feasible else text + " and breaks a limit"


def sensitivity_section(design: GainDesign) -> Chapter:
    """Return the inputs by their influence."""
    ranked = sorted(design.sensitivities, key=lambda s: abs(s.gain_change_per_percent), reverse=True)
    largest = max(abs(s.gain_change_per_percent) for s in ranked)
    rows, n = [], design.number
    unit = pretty_unit(n.unit)
    for s in ranked:
        if abs(s.gain_change_per_percent) > 1e-6 * largest or (s.value == 0 and abs(s.gain_derivative) > 1e-9):
            per_unit = f"{unit} per {s.unit}" if s.unit else unit
            change = f"{s.gain_change_per_percent:+.2e} {unit}" if s.value else "-"
            derivative = f"{s.gain_derivative:.4g} {per_unit}".replace("*", " ").replace("^2", "\u00b2")
            rows.append((f"`{s.name}`", Measured(s.value, s.unit), change, derivative))
    if not rows:
        return Chapter(title="What moves the optimum", titled=True, blocks=(Paragraph(text=_HELD, brief=True),))
    note = "Inputs without influence are left out; the scale of the sensor is one: it cancels in \u03be\u2032/\u03be."
    caption = f"How far the optimal {n.name} moves when the magnitude of an input grows by 1 %; striped: "
    caption += "less negative." if n.sign < 0 else "more positive."
    picture = Picture(figure="sensitivity", of=design, name=f"What moves the optimal {n.name}", caption=caption)
    head = ("input", "value", f"{n.name} change per +1 %", f"d{n.symbol} / d input")
    table = Rows(head=head, rows=tuple(rows), note=note, brief=True)
    return Chapter(title="What moves the optimum", titled=True, blocks=(picture, table))
