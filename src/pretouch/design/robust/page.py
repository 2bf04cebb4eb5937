"""What a robust design says: the gain, what fresh samples hold against it, and what is worth measuring better."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import partial
from typing import Final

import numpy as np

from pretouch._core.blocks import Cell, Chapter, LazyBlock, Measured, Page, Paragraph, Picture, Rows, named
from pretouch._core.units import format_quantity, format_range
from pretouch._core.vocabulary import unit_of, words_for
from pretouch.motion.page_sections import inputs_section, method_section, solved_on
from pretouch.motion.scenario import input_units
from pretouch.uncertainty.ensemble import share_in_words, uncertainty_in_words

from ..certificate import DesignStatus
from ..constraints import impact_rows
from ..page import objective_rows
from .beside import InputImportance, Price
from .problem import LimitOutcome, Validation
from .result import RobustDesign


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
    table = Rows(head=head, rows=tuple(_price_row(p, design.number.unit) for p in design.prices), note=note)
    picture = Picture(figure="price", of=design, name=name, caption=caption)
    return Chapter(title="What knowing one input would gain", blocks=(picture, table))


def _price_row(price: Price, unit: str) -> tuple[Cell, ...]:
    at = int(np.nanargmax(price.loss))
    best = price.best_gain[np.isfinite(price.best_gain)]
    gains = format_range((float(best.min()), float(best.max())), unit)
    most = f"{100 * float(price.loss[at]):.3g} % at {format_quantity(float(price.value[at]), price.unit)}"
    usual = f"{100 * float(np.nanmedian(price.loss)):.2g} %"
    return price.name, format_range((price.low, price.high), price.unit), gains, most, usual


Row = tuple[Cell, ...]

_STATUS: Final = {
    DesignStatus.OPTIMAL: "robust gain found",
    DesignStatus.INFEASIBLE: "infeasible: no gain within the bounds meets every constraint as often as it must",
    DesignStatus.NO_CONTACT: "no contact: no gain within the bounds ends in contact as often as the measure asks for",
}
_NO_WAY_OUT: Final = {
    DesignStatus.INFEASIBLE: (
        "No gain within the bounds holds all constraints as often as they ask for. What can be tried: a smaller "
        "probability, a relaxed limit, a wider range of gains, an earlier detection, another admittance, or knowing "
        "the inputs better."
    ),
    DesignStatus.NO_CONTACT: (
        "The measure counts encounters that end in contact with no gain. A quantile leaves a share of them out; or cut "
        "off what is possible where there is no contact."
    ),
}


def robust_page(design: RobustDesign) -> Page:
    """Describe a robust design of any status."""
    way_out, v = _NO_WAY_OUT.get(design.status), design.validation
    premise = Paragraph(
        text="The gain is optimal for a sample average with common samples. The inputs are distributed as stated: "
        "nothing here tests that, and an input that is distributed otherwise voids every share and every interval "
        "above."
    )
    return Page(
        kind="Gain for inputs that are not known exactly",
        headline=design.headline,
        status=_STATUS[design.status],
        good=design.status is DesignStatus.OPTIMAL,
        key_figures=() if v is None else tuple(_key_figures(design, v)),
        warnings=design.warnings,
        blocks=(
            None if way_out is None else Paragraph(text=way_out),
            None if v is None else _outcome(design, v),
            None if v is None or not v.limits else _constraints(v),
            _worst(design),
            _uncertain(design),
            _measure(design),
            _encounters(design),
            importance_section(design.importance),
            LazyBlock(make=partial(price_section, design)),
            _evidence(design),
            inputs_section(
                design.scenario,
                design.sensor,
                (f"{design.number.name}: bounds", format_range(design.bounds, design.number.unit)),
                *impact_rows(design.impact),
            ),
            method_section(design.method, solved_on=solved_on(design), others=(premise,)),
        ),
    )


def _section(title: str, head: Row, rows: Iterable[Row], note: str, *, wraps: bool = False) -> Chapter:
    table = Rows(head=head, rows=tuple(rows), note=note, brief=True, wraps=wraps)
    return Chapter(title=title, blocks=(table,), titled=not head)


def _key_figures(design: RobustDesign, v: Validation) -> Iterator[tuple[str, Cell]]:
    label, name, n = design.measure.label, design.nominal_name, design.number
    yield f"robust {n.label}", Measured(design.gain, n.unit)
    yield f"{label} of the objective, fresh samples", Measured(v.value)
    yield f"{name} {n.symbol}", Measured(design.nominal_gain, n.unit)
    if v.nominal is not None:
        yield f"{label} with the {name}", Measured(v.nominal)
    if v.loss is not None:
        yield f"more with the {name}", _loss(v)


def _loss(v: Validation) -> str:
    if v.loss is None:
        return ""
    error = v.loss.standard_error
    spread = f" \u00b1 {100 * error:.1g}" if math.isfinite(error) else ""
    return f"{100 * v.loss.relative:+.3g}{spread} %"


def _outcome(design: RobustDesign, v: Validation) -> Chapter:
    ideal = ", in continuous time and without noise" if design.on_evaluator else ""
    note = (
        f"{v.samples} fresh, independent encounters that the design has not seen. The {design.nominal_name} is optimal "
        f"where every input has its given value{ideal}; how much more it comes to is counted encounter by encounter. "
        "Predicted, not measured."
    )
    head = (f"on {v.samples} fresh samples ({100 * v.confidence:g} % confidence)", *design.compared)
    return _section("What the gain leads to", head, _outcome_rows(design, v), note)


def _outcome_rows(design: RobustDesign, v: Validation) -> Iterator[Row]:
    """Yield measure and contact of the gains side by side."""
    runs = design.compared.values()
    unbounded = ", the largest that was seen" if v.low == v.value else ""
    interval = f" ({v.low:.4g} to {v.high:.4g})" if math.isfinite(v.high) else unbounded
    found = [float(design.measure.of(run.objective)) for run in runs]
    cells = [Measured(value, beside="" if i else interval) for i, value in enumerate(found)]
    yield f"{design.measure.label} of the objective", *cells
    if v.loss is not None:
        yield "more than with the robust gain", "", _loss(v), ""
    yield "end in contact", *(share_in_words(float(run.reached.mean())) for run in runs)
    for name in ("relative_velocity", "largest_excursion", "time"):
        for words, share in (("median", 0.5), ("exceeded in 5 %", 0.95)):
            values = (run.reaches(name, share) for run in runs)
            yield f"{words_for(name)}, {words}", *(Measured(value, unit_of(name), 3) for value in values)


def _constraints(v: Validation) -> Chapter:
    note = (
        '"At least" is the exact lower bound (Clopper and Pearson) of the probability that the constraint holds, with '
        f'a confidence of {100 * v.confidence:g} %. "Shown": that bound is no less than what is required; "within '
        'chance": as few would be no surprise if it held as often as it must. A design that makes full use of a '
        "constraint sits on it, so that fresh samples hold it about as often as required and cannot show it: ask for a "
        "little more, to have that much shown."
    )
    head = ("constraint", "limit", "must hold in", "held in", "at least", "magnitude at that share", "state")
    return _section("Constraints", head, (_limit_row(o, v) for o in v.limits), note)


def _limit_row(outcome: LimitOutcome, v: Validation) -> Row:
    required, constraint = outcome.required, outcome.required.constraint
    return (
        named(constraint.quantity, magnitude=True),
        Measured(constraint.limit, constraint.unit),
        "every sample" if required.probability == 1 else f"{100 * required.probability:g} %",
        share_in_words(outcome.held),
        share_in_words(outcome.low),
        Measured(outcome.magnitude, constraint.unit),
        v.says_of(outcome),
    )


def _worst(design: RobustDesign) -> Chapter | None:
    """Say what the worst encounter is and why none is worse, where it was searched for."""
    w, units = design.worst, input_units(design.sensor)
    if w is None:
        return None
    ways = {1: ", with which the objective only grows", -1: ", with which the objective only falls"}
    rows: tuple[Row, ...] = (
        *((n, Measured(x, units.get(n, ""), beside=ways.get(w.monotone.get(n, 0), ""))) for n, x in w.inputs.items()),
        ("objective there", Measured(w.value, "", 6)),
        ("none exceeds", Measured(w.bound, "", 6)),
        ("no gain gets below", Measured(w.lower, "", 6)),
        ("boxes of inputs that were told apart", str(w.boxes)),
    )
    note = "Searched for and bounded, not sampled: no possible encounter exceeds that bound."
    return _section("The worst encounter", (), rows, note, wraps=True)


def _uncertain(design: RobustDesign) -> Chapter:
    rows = uncertainty_in_words(design.uncertainty, design.sensor)
    if design.on_evaluator:
        of = "of the sampled loop" if design.method == "loop" else "of the function that was given, if it has any"
        rows.append(("noise", f"that {of}, another run in each encounter"))
    note = (
        "Inputs are independent of each other where nothing else is said. All other inputs have their given values, "
        "which stand below."
    )
    head = ("uncertain input", "what is known of it")
    return _section("What is uncertain", head, rows, note, wraps=True)


def _measure(design: RobustDesign) -> Chapter:
    caption = (
        f"Left: the {design.measure.label} of the objective over the samples of the design, beside the objective of "
        f"the {'ideal' if design.on_evaluator else 'nominal'} encounter. Thin and grey: gains that break a constraint. "
        "Right: in how many of the fresh encounters the objective stays below a value."
    )
    name = "Measure of the objective over the gain, and distribution of the objective"
    rows = tuple(objective_rows(design.definition))
    terms = Rows(head=("term of the objective", "typical value", "weight"), rows=rows)
    picture = Picture(figure="robust", of=design, name=name, caption=caption)
    return Chapter(title="The measure over the gain", blocks=(picture, terms))


def _encounters(design: RobustDesign) -> Chapter | None:
    caption = (
        "In how many of the fresh encounters a quantity stays below a value. A curve that ends below 100 %: the others "
        "end without contact. Dotted: limits, and the share that is required of them. A curve that is missing is zero "
        "throughout."
    )
    picture = Picture(figure="outcome", of=design, name="Distributions of contact quantities", caption=caption)
    known = design.status is not DesignStatus.NO_CONTACT
    return Chapter(title="What encounters come to", blocks=(picture,)) if known else None


def _evidence(design: RobustDesign) -> Chapter:
    note = (
        "Every gain meets the same encounters, so that gains are compared and not samples. The gain is the best for "
        "these encounters; what it promises for others is what the fresh ones say."
    )
    return _section("How this is known", (), _evidence_rows(design), note, wraps=True)


def _evidence_rows(design: RobustDesign) -> Iterator[Row]:
    yield "searched", f"every gain from {format_range(design.bounds, design.number.unit)}"
    if design.strongest not in design.bounds:
        known = f"gains stronger than {design.number.text(design.strongest)}: none can be better"
        yield "left out by a proof", known
    yield "scan", f"{design.scanned} gains, each over the same {design.samples} encounters"
    if design.on_evaluator:
        what = "the sampled loop" if design.method == "loop" else f"{design.method}, by the function that was given"
        text = f"{what}, with the same noise for every gain; the ideal design is that in continuous time"
        yield "encounters run on", text
    yield "local minima found and refined", str(len(design.local_minima))
    yield "seed", str(design.seed)
