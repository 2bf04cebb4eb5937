"""A design as a JSON object, as text for a terminal and as a table for a notebook."""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pretouch._core.numbers import finite_or_none
from pretouch._core.text_table import aligned
from pretouch._core.units import format_quantity
from pretouch.motion import ContactResult, ContactStatus

from .quantities import QUANTITY_UNITS

if TYPE_CHECKING:
    from .result import GainDesign, IdealDesign

__all__ = ["contact_as_dict", "design_as_dict", "design_as_html", "design_as_text", "headline", "ideal_in_words"]

_SHOWN = (
    ("time", "time of contact"),
    ("position", "plant position at contact"),
    ("relative_velocity", "relative velocity at contact"),
    ("virtual_force", "virtual force at contact"),
    ("largest_excursion", "largest excursion |x - x_d|"),
    ("largest_speed", "largest plant speed"),
    ("largest_acceleration", "largest plant acceleration"),
    ("largest_virtual_force", "largest virtual force"),
)

_METHODS = {"loop": "sampled loop, run with every gain"}


def contact_as_dict(result: ContactResult | None) -> dict[str, Any] | None:
    """Return an encounter as a JSON object; its quantities are those at the end of the run, see `status`."""
    if result is None:
        return None
    return {
        "status": ContactStatus(result.status).label,
        "gain": result.gain,
        **{name: finite_or_none(value) for name, value in result.end.as_dict().items()},
        "closest_distance": finite_or_none(result.closest_distance),
        "settling_distance": finite_or_none(result.settling_distance),
        "impulse_residual": finite_or_none(result.impulse_residual),
    }


def design_as_dict(design: GainDesign) -> dict[str, Any]:
    """Return a design as one JSON object: numbers in SI, None where there is none."""
    c = design.certificate
    return {
        "status": design.status.value,
        "method": design.method,
        "gain": design.gain,
        "objective": design.objective,
        "objective_name": design.definition.name,
        "objective_terms": design.objective_parts,
        "contact": contact_as_dict(design.result),
        "no_mitigation": contact_as_dict(design.no_mitigation),
        "nearest": contact_as_dict(design.nearest),
        "ideal": None
        if design.ideal is None
        else {
            "gain": design.ideal.gain,
            "objective": finite_or_none(design.ideal.objective),
            "loss": finite_or_none(design.ideal.loss),
            "feasible": design.ideal.feasible,
        },
        "damping_at_contact": design.damping_at_contact,
        "bounds": list(design.bounds),
        "constraints": [
            {
                "name": o.name,
                "quantity": o.quantity,
                "unit": o.unit,
                "limit": o.limit,
                "value": o.value,
                "margin": o.margin,
                "active": o.active,
                "achievable": o.achievable,
                "best_value": o.best_value,
                "best_gain": o.best_gain,
            }
            for o in design.constraints
        ],
        "certificate": None
        if c is None
        else {
            "at": c.at,
            "scanned": c.scanned,
            "resolution": c.resolution,
            "local_minima": [list(m) for m in c.local_minima],
            "bracket": list(c.bracket),
            "stationarity": c.stationarity,
        },
        "sensitivities": [
            {
                "name": s.name,
                "value": s.value,
                "unit": s.unit,
                "gain_derivative": s.gain_derivative,
                "objective_derivative": s.objective_derivative,
            }
            for s in design.sensitivities
        ],
        "sensor": {
            "model": design.sensor.name,
            "parameters": design.sensor.parameters,
            "valid_range": [finite_or_none(v) for v in design.sensor.valid_range],
        },
        "trade_off": _trade_off_as_dict(design),
        "warnings": list(design.warnings),
    }


def _trade_off_as_dict(design: GainDesign) -> dict[str, list[Any]]:
    """Return the scan as columns, None where a gain ends without contact."""
    curve = design.trade_off

    def column(values: Any) -> list[float | None]:
        return [float(v) if there else None for v, there in zip(values, curve.reached, strict=True)]

    return {
        "gain": [float(v) for v in curve.gain],
        "objective": column(curve.objective),
        "feasible": [bool(v) for v in curve.feasible],
        **{name: column(getattr(curve.state, name)) for name in ("time", "displacement", "relative_velocity")},
    }


def headline(design: GainDesign) -> str:
    """Return the answer in one or two sentences."""
    if design.result is not None and design.gain is not None:
        left = abs(design.result.end.relative_velocity)
        text = f"Optimal gain D_p = {format_quantity(design.gain, 'N*s')}: contact at {format_quantity(left, 'm/s')}"
        before = design.no_mitigation
        if before.reached.all():
            speed = abs(before.end.relative_velocity)
            text += (
                f" instead of {format_quantity(speed, 'm/s')} without mitigation "
                f"({100 * (1 - left / speed):.1f} % less)"
            )
        return text + f", after an excursion of {format_quantity(design.result.end.largest_excursion, 'm')}."
    if design.nearest is not None:
        return "Infeasible: " + _conflict(design)
    return "No gain within the bounds ends in contact."


def _conflict(design: GainDesign) -> str:
    """Name the constraint that cannot be met and its nearest achievable value, or those that exclude each other."""
    impossible = [o for o in design.constraints if not o.achievable]
    if impossible:
        return "; ".join(
            f"{o.name} cannot be held at {format_quantity(o.limit, o.unit)}: the nearest achievable value is "
            f"{format_quantity(o.best_value or 0.0, o.unit)}, at D_p = {format_quantity(o.best_gain or 0.0, 'N*s')}"
            for o in impossible
        )
    names = " and ".join(o.name for o in design.constraints)
    nearest = ", ".join(
        f"{o.name} {format_quantity(o.value or 0.0, o.unit)} (limit {format_quantity(o.limit, o.unit)})"
        for o in design.constraints
    )
    gain = format_quantity(design.nearest.gain if design.nearest else 0.0, "N*s")
    return f"{names} cannot be held together; nearest, at D_p = {gain}: {nearest}"


def design_as_text(design: GainDesign) -> str:
    """Return a design as text for a terminal."""
    lines = [headline(design), ""]
    lines += [f"warning: {w}" for w in design.warnings] + ([""] if design.warnings else [])
    lines += [*aligned([("", "without mitigation", _column_name(design)), *_contact_rows(design)]), ""]
    if design.constraints:
        lines += [*aligned([("constraint", "value", "limit", "margin", ""), *_constraint_rows(design)]), ""]
    if design.gain is not None and design.damping_at_contact is not None:
        damper = format_quantity(design.damping_at_contact, "N*s/m")
        lines += [
            f"gain and sensor together: D_p g(0) = {damper}, the damper that acts at contact; D_p alone says nothing "
            "across sensors"
        ]
    if design.objective is not None:
        parts = ", ".join(f"{k} {v:.4g}" for k, v in design.objective_parts.items())
        lines += [f"objective ({design.definition.name}): {design.objective:.5g}" + (f" = {parts}" if parts else "")]
    lines += _evidence(design)
    if design.sensitivities:
        lines += ["", "how the optimum follows its inputs:"]
        head = ("input", "value", "gain change per +1 %")
        rows = [
            (s.name, format_quantity(s.value, s.unit), f"{s.gain_change_per_percent:+.2e} N s")
            for s in design.sensitivities
            if s.gain_change_per_percent != 0
        ]
        lines += aligned([head, *rows])
    return "\n".join(lines)


def design_as_html(design: GainDesign) -> str:
    """Return a design as a small table for a notebook."""
    rows = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in _contact_rows(design)
    )
    head = "".join(f"<th>{html.escape(h)}</th>" for h in ("", "without mitigation", _column_name(design)))
    warnings = "".join(f"<p>Warning: {html.escape(w)}</p>" for w in design.warnings)
    return f"<p><b>{html.escape(headline(design))}</b></p>{warnings}<table><tr>{head}</tr>{rows}</table>"


def _column_name(design: GainDesign) -> str:
    chosen = design.result or design.nearest
    if chosen is None:
        return ""
    return f"{'optimal' if design.result else 'nearest'}, D_p = {format_quantity(chosen.gain, 'N*s')}"


def _contact_rows(design: GainDesign) -> list[tuple[str, ...]]:
    chosen = design.result or design.nearest
    rows: list[tuple[str, ...]] = []
    if not design.no_mitigation.reached.all() or chosen is None:
        states = [design.no_mitigation, chosen]
        rows.append(("ends with", *("" if s is None else ContactStatus(s.status).label for s in states)))
    for name, label in _SHOWN:
        cells = [
            "" if r is None else format_quantity(getattr(r.end, name), QUANTITY_UNITS[name])
            for r in (design.no_mitigation, chosen)
        ]
        rows.append((label, *cells))
    if design.impact is not None:
        cells = [
            "" if r is None else format_quantity(float(design.impact.peak_force(r.end.relative_velocity)), "N")
            for r in (design.no_mitigation, chosen)
        ]
        rows.append(("peak impact force", *cells))
    return rows


def _constraint_rows(design: GainDesign) -> list[tuple[str, ...]]:
    rows = []
    for o in design.constraints:
        note = "active" if o.active else "" if o.margin is None or o.margin >= 0 else "EXCEEDED"
        shown = ["-" if v is None else format_quantity(v, o.unit) for v in (o.value, o.limit, o.margin)]
        rows.append((o.name, *shown, note))
    return rows


def _evidence(design: GainDesign) -> list[str]:
    c = design.certificate
    if c is None or design.result is None:
        return []
    where = {
        "interior": "inside the bounds",
        "bound": "on a bound",
        "edge of contact": "where contact is just still made",
        "corner": "inside the bounds, at a corner or a jump of the objective",
    }.get(c.at, f"on the constraint {c.at}")
    minima = "one local minimum" if len(c.local_minima) == 1 else f"{len(c.local_minima)} local minima"
    slope = "" if c.stationarity is None else f", |d ln f / d ln D_p| = {c.stationarity:.0e} at the optimum"
    low, high = design.bounds
    lines = [f"evidence: {c.scanned} gains over [{low:g}, {high:g}] N s show {minima}; the best lies {where}{slope}"]
    residual = np.asarray(design.result.impulse_residual)
    if np.isfinite(residual).all():
        lines += [f"motion: {design.method}, impulse balance met to {float(residual):.0e} of its largest term"]
    else:
        lines += [f"motion: {_METHODS.get(design.method, design.method)}"]
    if design.ideal is not None:
        lines += [f"ideal design: {ideal_in_words(design.ideal)}"]
    return lines


def ideal_in_words(ideal: IdealDesign) -> str:
    """Say what the gain of the ideal design comes to where another was designed.

    Args:
        ideal: the ideal design.

    Returns:
        Text such as `-0.7463 N s, which here is 24 % worse`.
    """
    text = f"{format_quantity(ideal.gain, 'N*s')}, which here "
    if not math.isfinite(ideal.objective):
        return text + "ends without contact"
    share = abs(100 * ideal.loss)
    text += f"is {share:.0f} % " if share >= 100 else f"is {share:.2g} % "
    text += "worse" if ideal.loss >= 0 else "better"
    return text if ideal.feasible else text + " and breaks a limit"
