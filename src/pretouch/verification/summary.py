"""A verdict as a JSON object, as text for a terminal and as a table for a notebook."""

from __future__ import annotations

import html
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pretouch._core.json_text import plain
from pretouch._core.text_table import aligned
from pretouch._core.units import format_quantity
from pretouch.uncertainty.describing import share_in_words

from .parts import LimitCheck, Spread, StabilityCheck
from .proposals import Change
from .wording import best_gain_in_words, change_in_words, headline, lacks_in_words

if TYPE_CHECKING:
    from .result import Verdict

__all__ = ["verdict_as_dict", "verdict_as_html", "verdict_as_text"]

_HEAD = ("", "predicted", "simulated", "5 % to 95 %", "worst", "without mitigation")


def verdict_as_dict(verdict: Verdict) -> dict[str, Any]:
    """Return a verdict as one JSON object: numbers in SI, None where there is none."""
    v, loss = verdict, verdict.loss
    found: dict[str, Any] = plain(
        {
            "status": v.status.value,
            "headline": v.headline,
            "gain": v.gain,
            "reasons": v.reasons,
            "runs": v.runs,
            "compared_runs": v.compared_runs,
            "seed": v.seed,
            "confidence": v.confidence,
            "objective_name": v.definition.name,
            "design": {"status": v.design.status.value, "gain": v.design.gain, "objective": v.design.objective},
            "predicted": v.predicted,
            "reached": None if v.reached is None else asdict(v.reached),
            "effect": None if v.effect is None else {**asdict(v.effect), "is_harder": v.effect.is_harder},
            "comparisons": [asdict(c) for c in v.comparisons],
            "limits": [_limit_as_dict(check) for check in v.limits],
            "stability": None if v.stability is None else _stability_as_dict(v.stability),
            "stability_text": v.stability_text,
            "calibration_check": None if v.calibration_check is None else v.calibration_check.to_dict(),
            "loss": None
            if loss is None
            else {
                "predicted": loss.predicted,
                "objective": loss.objective,
                "standard_error": loss.standard_error,
                "loop_gain": loss.loop_gain,
                "sought_margin": loss.sought_margin,
                "loop_objective": loss.loop_objective,
                "loss": loss.loss,
                "loss_error": loss.loss_error,
                "curve": {
                    "gain": loss.curve.gain,
                    "objective": loss.curve.objective,
                    "standing": loss.curve.standing,
                    "share": loss.curve.share,
                    "runs": loss.curve.runs,
                },
            },
            "changes": [asdict(change) for change in v.changes],
            "best_change": None if v.best_change is None else v.best_change.name,
            "assumptions": v.assumptions,
            "warnings": v.warnings,
        }
    )
    return found


def _limit_as_dict(check: LimitCheck) -> dict[str, Any]:
    return {
        "name": check.name,
        "label": check.label,
        "limit": check.limit,
        "unit": check.unit,
        "probability": check.required.probability,
        "is_met": check.is_met,
        "predicted": check.predicted,
        "held": check.held,
        "held_at_least": check.low,
        "value": check.value,
        "margin": check.margin,
        "source": check.source,
    }


def _stability_as_dict(check: StabilityCheck) -> dict[str, Any]:
    return {
        "margin": check.margin,
        "strongest": check.strongest,
        "critical_distance": check.critical_distance,
        "frequency": check.frequency,
        "rate": check.rate,
        "lowest_rate": check.lowest_rate,
        "lowest_rate_with_margin": check.lowest_rate_with_margin,
        "distance": check.limit.distance,
        "gain": check.limit.gain,
    }


def verdict_as_text(verdict: Verdict) -> str:
    """Return a verdict as text for a terminal."""
    lines = [headline(verdict)]
    if verdict.reasons:
        lines += ["", "why", *(f"  {reason}" for reason in verdict.reasons)]
    lines += ["", *(f"warning: {w}" for w in verdict.warnings)] if verdict.warnings else []
    if verdict.comparisons:
        lines += ["", *aligned([_HEAD, *_rows(verdict)])]
    if verdict.limits:
        head = ("limit", "predicted", "on the loop", "margin", "held")
        lines += ["", *aligned([head, *(_limit_row(check, verdict.confidence) for check in verdict.limits)])]
    if verdict.stability_text:
        lines += ["", verdict.stability_text]
    check = verdict.calibration_check
    if check is not None and check.is_good_enough:  # else it is one of the reasons
        lines += ["", check.text]
    lines += _loss(verdict)
    lines += _changes(verdict)
    if verdict.assumptions:
        lines += ["", "what this rests on", *(f"  {text}" for text in verdict.assumptions)]
    return "\n".join(lines)


def verdict_as_html(verdict: Verdict) -> str:
    """Return a verdict as a small table for a notebook."""
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in _HEAD)
    rows = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in _rows(verdict)
    )
    warnings = "".join(f"<p>Warning: {html.escape(w)}</p>" for w in verdict.warnings)
    table = f"<table><tr>{head}</tr>{rows}</table>" if rows else ""
    return f"<p><b>{html.escape(headline(verdict))}</b></p>{warnings}{table}"


def _rows(verdict: Verdict) -> list[tuple[str, ...]]:
    return [
        (
            c.label,
            "-" if c.predicted is None else format_quantity(c.predicted, c.unit),
            *_spread_cells(c.simulated, c.unit),
            "-" if c.unmitigated is None else format_quantity(c.unmitigated.mean, c.unit),
        )
        for c in verdict.comparisons
    ]


def _spread_cells(spread: Spread | None, unit: str) -> tuple[str, str, str]:
    if spread is None:
        return "-", "-", "-"
    between = f"{format_quantity(spread.low, unit)} to {format_quantity(spread.high, unit)}"
    return format_quantity(spread.mean, unit), between, format_quantity(spread.worst, unit)


def _limit_row(check: LimitCheck, confidence: float) -> tuple[str, ...]:
    shown = ["-" if v is None else format_quantity(v, check.unit) for v in (check.predicted, check.value, check.margin)]
    said = f"in {share_in_words(check.held)}, at least {share_in_words(check.low)}"
    said += f" at {100 * confidence:g} % confidence" + ("" if check.is_met else ": MISSED")
    p = check.required.probability
    return f"{check.statement} {'always' if p == 1 else f'with probability {p:g}'}", *shown, said


def _loss(verdict: Verdict) -> list[str]:
    loss = verdict.loss
    if loss is None or loss.objective is None:
        return []
    text = f"objective ({verdict.definition.name}): {loss.objective:.5g} on the loop"
    if loss.predicted is not None:
        text += f", {loss.predicted:.5g} predicted"
    lines = ["", text]
    best = best_gain_in_words(loss)
    kept = ", keeping the limits" if verdict.limits else ""
    if loss.loop_gain is None:
        return [*lines, f"{best}{kept}: none"]
    best += f"{kept}: {format_quantity(loss.loop_gain, 'N*s')}"
    if loss.loop_objective is None or loss.loss is None:
        return [*lines, best]
    error = "" if loss.loss_error is None else f" +- {100 * loss.loss_error / loss.loop_objective:.2g}"
    share = 100 * loss.loss / loss.loop_objective
    said = f"is {share:.3g}{error} % worse"
    if share < 0:
        said = f"is {-share:.3g}{error} % better{lacks_in_words(verdict)}"
    return [*lines, f"{best}, {loss.loop_objective:.5g}; the gain that was verified {said}"]


def _changes(verdict: Verdict) -> list[str]:
    if not verdict.changes:
        return []
    lines = ["", f"what would help most: {change_in_words(verdict)}", "what was tried"]
    return lines + [f"  {_effect(change).rjust(24)}  {change.sentence}" for change in verdict.changes]


def _effect(change: Change) -> str:
    parts = []
    if change.held is not None:
        parts.append(f"held {100 * change.held:.4g} %")
    if change.improvement is not None:
        parts.append(f"objective {-100 * change.improvement:+.2f} %")
    return ", ".join(parts) or "-"
