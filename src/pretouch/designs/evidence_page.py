"""Build the report sections on optimality and input sensitivity."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from pretouch._core.blocks import Cell, Measured, PageSection, PageTable, Paragraph, Picture
from pretouch._core.units import format_range, pretty_unit
from pretouch.motion import LawNumber
from pretouch.motion.page_sections import solved_on

from .certificate import IdealDesign
from .gain import GainDesign

Row = tuple[Cell, ...]

_SENSITIVITY: Final = "Sensitivity of the optimum"
_INSENSITIVE: Final = "The optimal gain does not change with any input: the active limit does not depend on them."
_PLACES: Final = {
    "interior": "inside the bounds, where the objective is stationary",
    "bound": "on a bound of the gain: a wider range may contain a better gain",
    "edge of contact": "at the edge of contact: with any stronger gain there is no contact",
    "reserve": "at the smallest distance that a gain keeps from a jump of the objective",
    "corner": "inside the bounds, at a corner or a jump of the objective, where no derivative exists",
}


def evidence_section(design: GainDesign) -> PageSection:
    """Return the report section that shows why the gain is optimal."""
    certificate = design.certificate
    note = "The scan covers the whole range, so the optimum does not depend on a starting point."
    if solved_on(design) != "loop":
        note += (
            " The impulse balance follows from the equations of motion L(1) and L(2) for every sensor curve, so a "
            "small residual certifies the motion."
        )
    table = PageTable(rows=tuple(_certificate_rows(design)), wraps=True, brief=certificate is not None, note=note)
    minima = () if certificate is None or len(certificate.local_minima) < 2 else certificate.local_minima
    others = PageTable(
        head=(f"local minimum at {design.number.symbol}", "objective"),
        rows=tuple((Measured(gain, design.number.unit), Measured(value, "", 5)) for gain, value in minima),
    )
    return PageSection(title="Evidence", titled=True, blocks=(table, others if minima else None))


def _certificate_rows(design: GainDesign) -> Iterator[Row]:
    c = design.certificate
    yield "searched", f"every gain from {format_range(design.bounds, design.number.unit)}"
    if c is None:
        yield "scan", f"{len(design.trade_off.gain)} gains"
    else:
        text = (
            f"the search evaluated {c.scanned} gains. Between these gains, the interpolated objective has a relative "
            f"error of at most {c.resolution:.1e}"
        )
        yield "scan", text
        yield "local minima found and refined", str(len(c.local_minima))
        yield "the optimum lies", _PLACES.get(c.at, f"on the limit of the constraint {c.at.replace('_', ' ')}")
        low, high = (design.number.text(b, 8) for b in sorted(c.bracket))
        yield "enclosed between", f"{low} and {high}"
        if c.stationarity is not None:
            yield f"first-order residual |df / d ln|{design.number.symbol}|| / f", f"{c.stationarity:.1e}"
    if design.ideal is not None:
        yield "ideal design, in continuous time", ideal_in_words(design.ideal, design.number)
    run = design.result or design.nearest
    if solved_on(design) == "loop":
        yield "motion", "sampled loop, simulated with every gain"
    if run is not None and solved_on(design) != "loop":
        residual = float(np.asarray(run.impulse_residual))
        missing = "not defined for the uniform motion" if run.method == "uniform-motion" else "not available"
        text = missing if math.isnan(residual) else f"residual {residual:.1e}, relative to its largest term"
        yield f"impulse balance of the motion ({run.method})", text


def ideal_in_words(ideal: IdealDesign, number: LawNumber) -> str:
    """Return a text about the gain that is optimal in continuous time.

    Returns:
        Text such as `-0.7463 N s, which here is 24 % worse`.
    """
    text = f"{number.text(ideal.gain)}, which here "
    if not math.isfinite(ideal.objective):
        return text + "ends without contact"
    share = abs(100 * ideal.loss)
    text += f"is {share:.0f} % " if share >= 100 else f"is {share:.2g} % "
    text += "worse" if ideal.loss >= 0 else "better"
    return text if ideal.feasible else text + " and exceeds a limit"


def sensitivity_section(design: GainDesign) -> PageSection:
    """Report the sensitivity of the optimal gain to each input.

    Returns:
        The report section, with the largest sensitivity first.
    """
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
        return PageSection(title=_SENSITIVITY, titled=True, blocks=(Paragraph(text=_INSENSITIVE, brief=True),))
    note = (
        "Inputs without influence are omitted, such as the scale of the sensor, which cancels in \u03be\u2032/\u03be."
    )
    striped = "less negative" if n.sign < 0 else "more positive"
    caption = (
        f"Each bar shows how much the optimal {n.name} changes if the magnitude of one input grows by 1 %. If the bar "
        f"is striped, the {n.name} becomes {striped}."
    )
    picture = Picture(figure="sensitivity", of=design, name=f"Sensitivity of the optimal {n.name}", caption=caption)
    head = ("input", "value", f"{n.name} change per +1 %", f"d{n.symbol} / d input")
    table = PageTable(head=head, rows=tuple(rows), note=note, brief=True)
    return PageSection(title=_SENSITIVITY, titled=True, blocks=(picture, table))
