"""What a report of a robust design says, section by section, as plain rows of text for the template."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from pretouch.design.certificate import DesignStatus
from pretouch.design.quantities import QUANTITY_UNITS
from pretouch.design.robust.result import LimitOutcome, Price, RobustDesign, Validation
from pretouch.design.robust.summary import robust_headline
from pretouch.design.robust.validation import least_probability
from pretouch.design.robust.wording import known_in_words, share_in_words, units_of

from .design_page import METHODS, scenario_rows, sensor_rows, solved_on
from .wording import number, objective_rows, quantity, quantity_label, word

__all__ = ["nominal_name", "robust_page"]

Row = tuple[str, ...]

_STATUS: Final = {
    DesignStatus.OPTIMAL: "robust gain found",
    DesignStatus.INFEASIBLE: "infeasible: no gain within the bounds meets every constraint as often as it must",
    DesignStatus.NO_CONTACT: "no contact: no gain within the bounds ends in contact as often as the measure asks for",
}


def robust_page(design: RobustDesign, prices: list[Price]) -> dict[str, Any]:
    """Collect the text of a report of a robust design.

    Args:
        design: a design of any status.
        prices: what knowing each input would gain, the dearest first; empty where there is no gain.

    Returns:
        The template's variables, all text.
    """
    v = design.validation
    return {
        "headline": robust_headline(design),
        "status": design.status.value,
        "status_text": _STATUS[design.status],
        "tiles": [] if v is None else list(_tiles(design, v)),
        "warnings": list(_warnings(design)),
        "measure": design.measure.label,
        "uncertain_rows": known_in_words(design),
        "check_head": ("on fresh samples", "robust gain", nominal_name(design), "no mitigation"),
        "check_rows": [] if v is None else list(_check_rows(design, v)),
        "validation": {}
        if v is None
        else {"samples": str(v.samples), "confidence": f"{100 * v.confidence:g} %", "seed": str(design.seed)},
        "constraint_rows": [] if v is None else [_constraint_row(o, v) for o in v.limits],
        "worst_rows": list(_worst_rows(design)),
        "price_rows": [_price_row(price) for price in prices],
        "importance_rows": list(_importance_rows(design)),
        "certificate_rows": list(_certificate_rows(design)),
        "objective_rows": list(objective_rows(design.definition)),
        "scenario_rows": list(scenario_rows(design.scenario)),
        "sensor_rows": list(sensor_rows(design.sensor)),
        "method": METHODS.get(design.method, design.method),
        "solved_on": solved_on(design),
        "nominal_name": nominal_name(design),
    }


def nominal_name(design: RobustDesign) -> str:
    """Return what the nominal gain is called: where encounters are not ideal, it is that of the ideal design."""
    return "gain of the ideal design" if design.on_evaluator else "nominal gain"


def _tiles(design: RobustDesign, v: Validation) -> Iterator[tuple[str, str]]:
    """Yield the few numbers that matter most, with their names."""
    yield "robust gain D_p", quantity(design.gain, "N*s")
    yield f"{design.measure.label} of the objective, fresh samples", number(v.value)
    name = nominal_name(design)
    yield f"{name} D_p", quantity(design.nominal_gain, "N*s")
    if v.nominal is not None:
        yield f"{design.measure.label} with the {name}", number(v.nominal)
        if math.isfinite(v.nominal) and math.isfinite(v.value):
            beside = "ideal beside robust" if design.on_evaluator else "nominal beside robust"
            error = math.nan if v.loss is None else 100 * v.loss.standard_error
            spread = f" \u00b1 {error:.1g}" if design.on_evaluator and math.isfinite(error) else ""
            yield beside, f"{100 * (v.nominal / v.value - 1):+.2g}{spread} %"


def _warnings(design: RobustDesign) -> Iterator[str]:
    """Yield what should be read before relying on a gain, in order of weight."""
    v = design.validation
    if v is None or design.gain is None:
        return
    if v.reached < 1:
        yield (
            f"{100 * (1 - v.reached):.3g} % of the fresh encounters end without contact: the measure leaves them out, "
            "or is infinite."
        )
    for o in v.limits:
        if not _may_hold(o, v):
            yield (
                f"The fresh samples hold {word(o.required.constraint.name)} in {share_in_words(o.held)} only, less "
                f"often than the {100 * o.required.probability:g} % that the design held in its own samples: take more "
                "samples, or ask for a slightly larger probability."
            )
    if design.gain in design.bounds:
        yield (
            f"The optimum lies on the bound {quantity(design.gain, 'N*s')}: a wider range of gains may hold a better "
            "one."
        )


def _check_rows(design: RobustDesign, v: Validation) -> Iterator[Row]:
    """Yield measure and contact of the gains side by side."""
    runs = [design.outcomes(g) if g is not None else None for g in (design.gain, design.nominal_gain, 0.0)]
    interval = f" ({number(v.low)} to {number(v.high)})" if math.isfinite(v.high) else ""
    cells = [number(v.value) + interval]
    cells += ["\u2013" if run is None else number(float(design.measure.of(run.objective))) for run in runs[1:]]
    yield (f"{design.measure.label} of the objective", *cells)
    yield ("ends in contact", *("\u2013" if run is None else share_in_words(float(run.reached.mean())) for run in runs))
    for name in ("relative_velocity", "largest_excursion", "time"):
        for words, share in (("median", 0.5), ("exceeded in 5 %", 0.95)):
            found = [None if run is None else _quantile(run.magnitude(name), share) for run in runs]
            label = "relative speed at contact" if name == "relative_velocity" else quantity_label(name)
            yield (f"{label}, {words}", *(quantity(x, QUANTITY_UNITS[name], 3) for x in found))


def _quantile(values: Any, share: float) -> float:
    return float(np.sort(values)[math.ceil(share * len(values)) - 1])


def _may_hold(outcome: LimitOutcome, v: Validation) -> bool:
    """Tell whether the samples leave it open that a constraint holds as often as it must."""
    missed = v.samples - round(outcome.held * v.samples)
    return 1 - least_probability(missed, v.samples, v.confidence) >= outcome.required.probability


def _constraint_row(outcome: LimitOutcome, v: Validation) -> Row:
    required, constraint = outcome.required, outcome.required.constraint
    if outcome.held < required.probability:
        state = "missed, within chance" if _may_hold(outcome, v) else "missed"
    elif outcome.low >= required.probability:
        state = "shown"
    else:
        state = "held in every sample" if outcome.held == 1 else "held, not shown"
    return (
        f"{word(constraint.name)}: {quantity_label(constraint.quantity)}",
        quantity(constraint.limit, constraint.unit),
        "every sample" if required.probability == 1 else f"{100 * required.probability:g} %",
        share_in_words(outcome.held),
        share_in_words(outcome.low),
        quantity(outcome.magnitude, constraint.unit),
        state,
    )


def _worst_rows(design: RobustDesign) -> Iterator[Row]:
    """Yield the worst encounter and why none is worse, where it was searched for."""
    w = design.worst
    if w is None:
        return
    units = units_of(design.sensor)
    for name, value in w.inputs.items():
        sign = w.monotone.get(name, 0)
        text = "" if not sign else f", with which the objective only {'grows' if sign > 0 else 'falls'}"
        yield name, quantity(value, units.get(name, "")) + text
    yield "objective there", number(w.value, 6)
    yield "none exceeds", f"{number(w.bound, 6)}, for which {w.boxes} boxes of inputs were told apart"
    yield "no gain gets below", number(w.lower, 6)


def _price_row(price: Price) -> Row:
    at = int(np.nanargmax(price.loss))
    best = price.best_gain[np.isfinite(price.best_gain)]
    return (
        price.name,
        f"{quantity(price.low, price.unit)} to {quantity(price.high, price.unit)}",
        f"{quantity(float(best.min()), 'N*s')} to {quantity(float(best.max()), 'N*s')}",
        f"{100 * float(price.loss[at]):.3g} % at {quantity(float(price.value[at]), price.unit)}",
        f"{100 * float(np.nanmedian(price.loss)):.2g} %",
    )


def _importance_rows(design: RobustDesign) -> Iterator[Row]:
    """Yield the share of the variance that each input has; one input alone has all of it."""
    found = [one for one in design.importance if math.isfinite(one.total)]
    for one in found if len(found) > 1 else ():
        shares = ((one.alone, one.alone_error), (one.total, one.total_error))
        yield (
            one.name,
            *(f"{max(0.0, 100 * share):.1f} % \u00b1 {100 * error:.1f}" for share, error in shares),
            "\u2013" if one.by_gradient is None else f"{100 * one.by_gradient:.1f} %",
        )


def _certificate_rows(design: RobustDesign) -> Iterator[Row]:
    low, high = design.bounds
    yield "searched", f"every gain from {quantity(low, 'N*s')} to {quantity(high, 'N*s')}"
    if design.strongest > low:
        yield "left out by a proof", f"gains stronger than {quantity(design.strongest, 'N*s')}: none can be better"
    yield "scan", f"{design.scanned} gains, each over the same {design.samples} encounters"
    yield "local minima found and refined", str(len(design.local_minima))
    yield "seed", str(design.seed)
    if design.validation is not None:
        text = f"{design.validation.samples} independent encounters that the design has not seen"
        yield "held against", text
