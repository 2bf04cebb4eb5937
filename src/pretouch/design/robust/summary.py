"""A robust design as a JSON object and as text for a terminal."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from pretouch._core.numbers import finite_or_none
from pretouch._core.units import format_quantity

from .wording import known_in_words, outcome_in_words, units_of

if TYPE_CHECKING:
    from .result import LossOfNominal, RobustDesign

__all__ = ["robust_as_dict", "robust_as_text", "robust_headline"]

_ROUNDING = 1e-12  # of a limit, as in the validation


def robust_as_dict(design: RobustDesign) -> dict[str, Any]:
    """Return a robust design as one JSON object: numbers in SI, None where there is none."""
    v, w = design.validation, design.worst
    measure = {"kind": type(design.measure).__name__, "label": design.measure.label, **_fields(design.measure)}
    return {
        "status": design.status.value,
        "gain": design.gain,
        "measure": measure,
        "value": design.value,
        "objective_name": design.definition.name,
        "method": design.method,
        "nominal_gain": design.nominal_gain,
        "nearest_gain": design.nearest_gain,
        "reachable": [
            {"name": r.required.constraint.name, "magnitude": r.magnitude, "gain": r.gain}
            for r in design.evidence.reachable()
        ],
        "validation": None
        if v is None
        else {
            "samples": v.samples,
            "confidence": v.confidence,
            "value": finite_or_none(v.value),
            "low": finite_or_none(v.low),
            "high": finite_or_none(v.high),
            "nominal": None if v.nominal is None else finite_or_none(v.nominal),
            "loss_of_nominal": None
            if v.loss is None
            else {"relative": finite_or_none(v.loss.relative), "standard_error": finite_or_none(v.loss.standard_error)},
            "reached": v.reached,
            "constraints": [
                {
                    "name": o.required.constraint.name,
                    "limit": o.required.constraint.limit,
                    "unit": o.required.constraint.unit,
                    "probability": o.required.probability,
                    "held": o.held,
                    "held_at_least": o.low,
                    "magnitude": finite_or_none(o.magnitude),
                }
                for o in v.limits
            ],
        },
        "worst": None
        if w is None
        else {
            "inputs": w.inputs,
            "value": w.value,
            "bound": w.bound,
            "lower": w.lower,
            "boxes": w.boxes,
            "monotone": w.monotone,
            "encounters": [list(row) for row in w.encounters],
        },
        "importance": [
            {
                "name": one.name,
                "inputs": list(one.inputs),
                "alone": finite_or_none(one.alone),
                "alone_error": finite_or_none(one.alone_error),
                "total": finite_or_none(one.total),
                "total_error": finite_or_none(one.total_error),
                "by_gradient": one.by_gradient,
            }
            for one in design.importance
        ],
        "local_minima": [list(m) for m in design.local_minima],
        "scanned": design.scanned,
        "strongest_gain_needed": design.strongest,
        "bounds": list(design.bounds),
        "samples": design.samples,
        "seed": design.seed,
        "uncertainty": {name: {"kind": type(k).__name__, **_fields(k)} for name, k in design.uncertainty.items()},
    }


def robust_headline(design: RobustDesign) -> str:
    """Return the answer in a sentence or two.

    Args:
        design: a design of any status.

    Returns:
        The text.
    """
    if design.gain is None:
        return {
            "infeasible": _conflict(design),
            "no-contact": f"No gain within the bounds ends in contact as often as the measure asks for "
            f"({design.measure.label}).",
        }[design.status.value]
    text = (
        f"Robust gain D_p = {format_quantity(design.gain, 'N*s')}: {design.measure.label} of the objective "
        f"{design.value:.4g}"
    )
    v = design.validation
    if v is None or design.nominal_gain is None or v.nominal is None or not math.isfinite(v.value):
        return text + "."
    which = "that of the ideal design" if design.on_evaluator else "optimal where nothing is uncertain"
    beside = f"the gain {format_quantity(design.nominal_gain, 'N*s')}, {which}"
    if not math.isfinite(v.nominal):
        return f"{text}; with {beside}, too many encounters end without contact."
    change = 100 * (v.nominal / v.value - 1)
    broken = _broken(design, design.nominal_gain)
    worse, but = ("worse", "and") if change >= 0 else ("better", "but")
    too = f", {but} does not hold {' and '.join(broken)} as often as it must" if broken else ""
    return f"{text}. On fresh samples {beside}, is {abs(change):.2g} % {worse}{too}."


def _conflict(design: RobustDesign) -> str:
    """Name the limits that no gain holds as often as it must, or say that they exclude each other."""
    said = []
    for found in design.evidence.reachable():
        c = found.required.constraint
        if found.magnitude > c.limit:
            often = (
                "in every sample" if found.required.probability == 1 else f"in {100 * found.required.probability:g} %"
            )
            said.append(
                f"{c.name} cannot be held at {format_quantity(c.limit, c.unit)} {often}: the least that is, is "
                f"{format_quantity(found.magnitude, c.unit)}, at D_p = {format_quantity(found.gain, 'N*s')}"
            )
    if said:
        return f"Infeasible: {'; '.join(said)}."
    return "Infeasible: each constraint can be held as often as it must, but no gain holds all of them."


def _broken(design: RobustDesign, gain: float) -> list[str]:
    """Name the constraints that a gain does not hold as often as it must, on fresh samples."""
    if not design.limits:
        return []
    found = design.outcomes(gain)
    shares = {r.constraint: r.share(found.magnitude(r.constraint.quantity) / r.constraint.limit) for r in design.limits}
    return [constraint.name for constraint, share in shares.items() if share > 1 + _ROUNDING]


def robust_as_text(design: RobustDesign) -> str:
    """Return a robust design as lines for a terminal."""
    low, high = design.bounds
    said = known_in_words(design)
    width = max(len(name) for name, _ in said)
    lines = [
        robust_headline(design),
        "",
        "uncertain",
        *(f"  {name.ljust(width)}  {text}" for name, text in said),
        *_validated(design),
        *_worst(design),
        *_importance(design),
        "",
        f"evidence: {design.scanned} gains over [{low:g}, {high:g}] N s, {design.samples} encounters each, seed "
        f"{design.seed}; {_count(design)}{_proved(design)}",
        *_motion(design),
    ]
    return "\n".join(lines)


def _motion(design: RobustDesign) -> list[str]:
    """Say what was run where that was not L(1) in continuous time."""
    if not design.on_evaluator:
        return []
    what = "the sampled loop" if design.method == "loop" else f"{design.method}, by the function that was given"
    return [f"motion: {what}, with the same noise for every gain; the ideal design is that in continuous time"]


def _importance(design: RobustDesign) -> list[str]:
    """Say what is worth measuring better."""
    found = [one for one in design.importance if math.isfinite(one.total)]
    if len(found) < 2:
        return []
    width = max(len(one.name) for one in found)
    lines = [
        "",
        "what the objective varies with (Sobol indices: alone, with all interactions, each +- its standard error)",
    ]
    for one in found:
        alone, total = (max(0.0, 100 * share) for share in (one.alone, one.total))
        lines.append(
            f"  {one.name.ljust(width)}  {alone:5.1f} % +- {100 * one.alone_error:.1f}   "
            f"{total:5.1f} % +- {100 * one.total_error:.1f}"
        )
    return lines


def _proved(design: RobustDesign) -> str:
    if design.strongest <= design.bounds[0]:
        return ""
    return f"; none stronger than {design.strongest:.4g} N s can be better"


def _count(design: RobustDesign) -> str:
    count = len(design.local_minima)
    return {0: "no minimum", 1: "one local minimum"}.get(count, f"{count} local minima")


def _validated(design: RobustDesign) -> list[str]:
    v = design.validation
    if v is None:
        return []
    rows = [(design.measure.label, _measured(v.value, v.low, v.high))]
    if v.nominal is not None and design.nominal_gain is not None:
        name = "with the gain of the ideal design" if design.on_evaluator else "with the nominal gain"
        rows.append((name, f"{v.nominal:.4g}{_lost(v.loss) if design.on_evaluator else ''}"))
    rows.append(("end in contact", f"{100 * v.reached:.4g} %"))
    rows += [(o.required.label, outcome_in_words(o, v.confidence)) for o in v.limits]
    width = max(len(name) for name, _ in rows)
    lines = ["", f"on {v.samples} fresh samples ({100 * v.confidence:g} % confidence)"]
    return lines + [f"  {name.ljust(width)}  {text}" for name, text in rows]


def _lost(loss: LossOfNominal | None) -> str:
    """Write a loss with its standard error."""
    if loss is None:
        return ""
    error = f" +- {100 * loss.standard_error:.2g}" if math.isfinite(loss.standard_error) else ""
    return f", {100 * loss.relative:.3g}{error} % more, encounter by encounter"


def _measured(value: float, low: float, high: float) -> str:
    if not math.isfinite(value):
        return "without end: encounters that count do not end in contact"
    if not math.isfinite(high):
        return f"{value:.4g}, the largest that was seen"
    return f"{value:.4g} ({low:.4g} to {high:.4g})"


def _worst(design: RobustDesign) -> list[str]:
    w = design.worst
    if w is None:
        return []
    units = units_of(design.sensor)
    where = ", ".join(f"{name} = {format_quantity(value, units.get(name, ''))}" for name, value in w.inputs.items())
    lines = [
        "",
        "worst encounter",
        f"  {where}",
        f"  objective {w.value:.6g}; none exceeds {w.bound:.6g} ({w.boxes} boxes told apart); "
        f"no gain gets below {w.lower:.6g}",
    ]
    for name, sign in w.monotone.items():
        lines.append(f"  {'grows' if sign > 0 else 'falls'} with {name} all over the box")
    return lines


def _fields(known: Any) -> dict[str, Any]:
    return {f.name: getattr(known, f.name) for f in fields(known)}
