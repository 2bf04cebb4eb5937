"""A robust design as a JSON object and as text for a terminal."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from pretouch.uncertainty import CorrelatedNormal

if TYPE_CHECKING:
    from .result import RobustDesign

__all__ = ["robust_as_dict", "robust_as_text"]


def robust_as_dict(design: RobustDesign) -> dict[str, Any]:
    """Return a robust design as one JSON object: numbers in SI, None where there is none."""
    v, w = design.validation, design.worst
    return {
        "status": design.status.value,
        "gain": design.gain,
        "measure": {"kind": type(design.measure).__name__, "label": design.measure.label},
        "value": design.value,
        "nominal_gain": design.nominal_gain,
        "validation": None
        if v is None
        else {
            "samples": v.samples,
            "confidence": v.confidence,
            "value": _number(v.value),
            "low": _number(v.low),
            "high": _number(v.high),
            "nominal": None if v.nominal is None else _number(v.nominal),
            "reached": v.reached,
            "constraints": [
                {
                    "name": o.required.constraint.name,
                    "limit": o.required.constraint.limit,
                    "unit": o.required.constraint.unit,
                    "probability": o.required.probability,
                    "held": o.held,
                    "held_at_least": o.low,
                    "magnitude": _number(o.magnitude),
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
        "local_minima": [list(m) for m in design.local_minima],
        "scanned": design.scanned,
        "strongest_gain_needed": design.strongest,
        "bounds": list(design.bounds),
        "samples": design.samples,
        "seed": design.seed,
        "uncertainty": {name: {"kind": type(k).__name__, **_fields(k)} for name, k in design.uncertainty.items()},
    }


def robust_as_text(design: RobustDesign) -> str:
    """Return a robust design as lines for a terminal."""
    if design.gain is None or design.value is None:
        what = {
            "infeasible": "no gain within the bounds meets the constraints as often as they ask for",
            "no-contact": "no gain within the bounds ends in contact as often as the measure asks for",
        }[design.status.value]
        return f"{design.status.value}: {what}"
    low, high = design.bounds
    lines = [
        f"D_p = {design.gain:.4g} N s   ({design.measure.label} of the objective {design.value:.4g}; "
        f"bounds {low:g} to {high:g} N s)",
        "",
        "uncertain",
        *(f"  {name:<22} {_said(known)}" for name, known in design.uncertainty.items()),
    ]
    lines += _validated(design) + _worst(design)
    return "\n".join(lines)


def _validated(design: RobustDesign) -> list[str]:
    v = design.validation
    if v is None:
        return []
    percent = f"{100 * v.confidence:g} %"
    lines = ["", f"on {v.samples} fresh samples ({percent} intervals)"]
    if math.isfinite(v.high):
        lines.append(f"  {design.measure.label:<22} {v.value:.4g}   ({v.low:.4g} to {v.high:.4g})")
    else:
        lines.append(f"  largest objective      {v.value:.4g}")
    if v.nominal is not None and design.nominal_gain is not None:
        share = f"{100 * (v.nominal / v.value - 1):+.2g} %" if math.isfinite(v.nominal) else "no contact in some"
        lines.append(
            f"  nominal gain           {v.nominal:.4g}   ({design.nominal_gain:.4g} N s, optimal where nothing is "
            f"uncertain: {share})"
        )
    lines.append(f"  end in contact         {100 * v.reached:.4g} %")
    for o in v.limits:
        c = o.required.constraint
        lines.append(
            f"  {o.required.label}: held in {100 * o.held:.4g} %, at least {100 * o.low:.4g} %; "
            f"{o.magnitude:.4g} {c.unit} at that probability"
        )
    return lines


def _worst(design: RobustDesign) -> list[str]:
    w = design.worst
    if w is None:
        return []
    where = ", ".join(f"{name} = {value:.4g}" for name, value in w.inputs.items())
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


def _said(known: Any) -> str:
    if isinstance(known, CorrelatedNormal):
        deviations = [math.sqrt(known.covariance[i][i]) for i in range(len(known.names))]
        return ", ".join(f"{n} {m:.4g} +- {d:.2g}" for n, m, d in zip(known.names, known.mean, deviations, strict=True))
    values = _fields(known)
    if "samples" in values:
        return f"{len(values['samples'])} measured values from {known.support[0]:.4g} to {known.support[1]:.4g}"
    return f"{type(known).__name__.lower()}, " + ", ".join(f"{k} {v:.4g}" for k, v in values.items())


def _fields(known: Any) -> dict[str, Any]:
    return {f.name: getattr(known, f.name) for f in fields(known)}


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
