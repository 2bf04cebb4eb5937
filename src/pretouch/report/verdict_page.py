"""What a report of a verdict says, section by section, as plain rows of text for the template."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

from pretouch.design.robust.wording import share_in_words, uncertainty_in_words
from pretouch.simulation import ClosedLoop
from pretouch.verification import (
    CalibrationCheck,
    Comparison,
    LimitCheck,
    Spread,
    StabilityCheck,
    Verdict,
    VerdictStatus,
)
from pretouch.verification.simulated import QUANTITY_WORDS

from .design_page import METHODS, scenario_rows, sensor_rows
from .loop_rows import chain_rows, contact_rows, controller_rows, loop_rows, robot_rows
from .verdict_changes import change_box, change_note, change_rows, loss_rows, loss_text
from .wording import number, objective_rows, quantity

__all__ = ["verdict_page"]

Row = tuple[str, ...]
Tile = tuple[str, str, list[tuple[str, str]]]

_DASH: Final = "\u2013"
_STATUS: Final = {
    VerdictStatus.HOLDS: "holds",
    VerdictStatus.HOLDS_NARROWLY: "holds narrowly",
    VerdictStatus.DOES_NOT_HOLD: "does not hold",
    VerdictStatus.NO_GAIN: "no gain",
}


def verdict_page(verdict: Verdict) -> dict[str, Any]:
    """Collect the text of a report of a verdict.

    Args:
        verdict: a verdict of any status.

    Returns:
        The template's variables, all text.
    """
    v, known = verdict, verdict.stability
    first, separator, rest = v.headline.partition("; ")
    return {
        "status": v.status.value,
        "status_text": _STATUS[v.status],
        "meaning": v.status.meaning,
        "headline": (first + separator.strip(), rest),
        "tiles": list(_tiles(v)),
        "reasons": [f"{reason[:1].upper()}{reason[1:]}." for reason in v.reasons],
        "asked_rows": list(_asked_rows(v)),
        "warnings": list(v.warnings),
        "runs": _runs(v),
        "change": change_box(v),
        "change_note": change_note(v),
        "change_rows": list(change_rows(v)),
        "tells_held": any(change.held is not None for change in v.changes),
        "comparison_rows": [_comparison_row(c) for c in v.comparisons],
        "reached": _reached(v),
        "limit_rows": [_limit_row(c) for c in v.limits],
        "sources": _sources(v),
        "confidence": f"{100 * v.confidence:g} %",
        "stability_text": v.stability_text,
        "stability_rows": [] if known is None else list(_stability_rows(known)),
        "calibration_text": "" if v.calibration_check is None else v.calibration_check.text,
        "calibration_rows": [] if v.calibration_check is None else list(_calibration_rows(v.calibration_check)),
        "loss_text": loss_text(v),
        "loss_rows": list(loss_rows(v)),
        "assumptions": list(v.assumptions),
        "uncertain_rows": list(uncertainty_in_words(v.uncertainty, v.sensor)),
        "objective_rows": list(objective_rows(v.definition)),
        "scenario_rows": list(scenario_rows(v.scenario)),
        "sensor_rows": list(sensor_rows(v.sensor)),
        "method": METHODS.get(v.design.method, v.design.method),
        **_loop(v.loop),
    }


def _loop(loop: ClosedLoop) -> dict[str, list[Row]]:
    return {
        "loop_rows": list(loop_rows(loop)),
        "chain_rows": list(chain_rows(loop.chain)),
        "controller_rows": list(controller_rows(loop.law)),
        "robot_rows": list(robot_rows(loop.plant)),
        "force_rows": list(contact_rows(loop.contact)),
    }


def _runs(v: Verdict) -> str:
    return f"{v.runs} run{'' if v.runs == 1 else 's'}"


def _tiles(v: Verdict) -> Iterator[Tile]:
    """Yield the few numbers that matter most: name, value, and what stands beside it."""
    if v.gain is None:
        return
    ideal = v.design.gain
    beside = [("ideal optimum", "the same" if ideal == v.gain else quantity(ideal, "N*s"))]
    yield "verified gain D_p", quantity(v.gain, "N*s"), beside
    speed, force = v.comparison("relative_velocity"), v.comparison("impact_force")
    if speed is not None:
        yield "speed at contact, mean of the runs", _mean(speed), list(_beside(speed))
    if force is not None:
        yield "impact force, mean of the runs", _mean(force), [*_beside(force), *_pushed(v.comparison("peak_force"))]
    yield from _stability_tiles(v.stability)


def _mean(compared: Comparison) -> str:
    return _DASH if compared.simulated is None else quantity(compared.simulated.mean, compared.unit, 3)


def _beside(c: Comparison) -> Iterator[tuple[str, str]]:
    """Yield what a simulated mean is to be held against."""
    if c.simulated is not None:
        yield "5 % to 95 %", _between(c.simulated, c.unit, 3)
    yield "predicted", quantity(c.predicted, c.unit, 3)
    if c.unmitigated is not None:
        yield "no mitigation", quantity(c.unmitigated.mean, c.unit, 3)


def _pushed(largest: Comparison | None) -> Iterator[tuple[str, str]]:
    """Yield the largest force of the whole contact: mitigation softens the impact, and not what pushes on after it."""
    if largest is not None:
        yield "largest of all", _mean(largest)
        free = largest.unmitigated
        yield "no mitigation", _DASH if free is None else quantity(free.mean, largest.unit, 3)


def _between(spread: Spread, unit: str, digits: int = 4) -> str:
    low, high = (quantity(x, unit, digits) for x in (spread.low, spread.high))
    (first, own), (last, other) = low.partition(" ")[::2], high.partition(" ")[::2]
    return f"{first} to {last} {other}".strip() if own == other else f"{low} to {high}"


def _stability_tiles(check: StabilityCheck | None) -> Iterator[Tile]:
    if check is None:
        yield "margin to instability", "not known", []
        return
    margin = "none unstable" if math.isinf(check.margin) else f"\u00d7 {number(check.margin, 3)}"
    yield "margin to instability", margin, [("unstable from", quantity(check.strongest, "N*s"))]
    rates = [("for a margin of 2", _rate(check.lowest_rate_with_margin)), ("the sensor has", _rate(check.rate))]
    yield "lowest rate for this gain", _rate(check.lowest_rate), rates


def _rate(rate: float) -> str:
    return "none is enough" if math.isinf(rate) else quantity(rate, "Hz", 3)


def _comparison_row(c: Comparison) -> Row:
    spread, free = c.simulated, c.unmitigated
    return (
        c.label,
        quantity(c.predicted, c.unit),
        _DASH if spread is None else quantity(spread.mean, c.unit),
        _DASH if spread is None else _between(spread, c.unit, 3),
        _DASH if spread is None else quantity(spread.worst, c.unit),
        quantity(c.predicted_unmitigated, c.unit),
        _DASH if free is None else quantity(free.mean, c.unit),
    )


def _reached(v: Verdict) -> str:
    """Say which runs came to a contact."""
    if v.reached is None:
        return ""
    text = f"A contact is predicted in {share_in_words(v.reached.predicted)} of the encounters, and came in "
    text += f"{share_in_words(v.reached.simulated)} of the {_runs(v)}"
    if v.reached.missing:
        text += f"; {v.reached.missing} end without the one that is predicted"
    if v.reached.low is not None:
        text += f". A predicted one comes with a probability of at least {share_in_words(v.reached.low)}, with a "
        text += f"confidence of {100 * v.confidence:g} %"
    return text + "."


def _asked_rows(v: Verdict) -> Iterator[Row]:
    """Yield the limits of a verdict without a gain, and how near the ideal world comes to each."""
    for c in v.design.constraints if v.gain is None else ():
        yield (
            QUANTITY_WORDS[c.quantity],
            quantity(c.limit, c.unit),
            quantity(c.best_value, c.unit),
            quantity(c.best_gain, "N*s"),
        )


def _limit_row(check: LimitCheck) -> Row:
    p, unit = check.required.probability, check.unit
    return (
        check.label,
        quantity(check.limit, unit),
        "every run" if p == 1 else f"{100 * p:g} %",
        share_in_words(check.held),
        share_in_words(check.low),
        quantity(check.value, unit),
        quantity(check.margin, unit),
        _state(check),
    )


def _state(check: LimitCheck) -> str:
    if not check.is_met:
        return "missed"
    if check.required.probability == 1:
        return "held in every run"
    return "shown" if check.low >= check.required.probability else "held, not shown"


def _sources(v: Verdict) -> list[str]:
    """Say of limits where their quantity comes from, as far as it is not simply simulated."""
    return [f"{c.label.capitalize()}: {c.source}." for c in v.limits if c.source != "simulated"]


def _stability_rows(check: StabilityCheck) -> Iterator[Row]:
    yield "margin: how many times the gain may grow", number(check.margin)
    yield "strongest stable gain", quantity(check.strongest, "N*s")
    if math.isfinite(check.strongest):
        yield "at the critical distance", quantity(check.critical_distance, "m")
    if math.isfinite(check.frequency):
        yield "where it oscillates at", quantity(check.frequency, "Hz")
    yield "rate of the sensor", quantity(check.rate, "Hz")
    yield "rate from which on this gain is stable", _rate(check.lowest_rate)
    yield "rate from which on it has a margin of 2", _rate(check.lowest_rate_with_margin)


def _calibration_rows(check: CalibrationCheck) -> Iterator[Row]:
    yield "speed at contact on the fitted curve", quantity(check.promised, "m/s")
    for label, value in (("5 %", check.low), ("half", check.median), ("95 %", check.high)):
        if value is not None:
            yield f"{label} of the sensors stay below", quantity(value, "m/s")
    for label, count in (
        ("contact is more than 15 % harder on", check.harder),
        ("a limit is missed that the fitted curve keeps on", check.broken),
        ("no contact comes on", check.missing),
    ):
        yield label, f"{count} of {check.draws}"
