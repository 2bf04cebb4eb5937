"""Build the report of a robust design.

It shows the gain, its validation and the most important inputs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import partial
from typing import Final

import numpy as np

from pretouch._core.blocks import (
    Cell,
    LazyBlock,
    Measured,
    Page,
    PageSection,
    PageTable,
    Paragraph,
    Picture,
    named_entry,
)
from pretouch._core.units import format_quantity, format_range
from pretouch._core.vocabulary import unit_of, words_for
from pretouch.motion.page_sections import RECEDING, inputs_section, method_section, solved_on
from pretouch.motion.scenario import input_units
from pretouch.uncertainty.ensemble import share_in_words, uncertainty_in_words

from ..certificate import DesignStatus
from ..impact import impact_rows
from ..page import objective_rows
from ..page_sentences import step_without_gain, verify_step
from .importance import InputImportance
from .measures import WorstCase
from .price import Price
from .result import RobustDesign
from .validation import LimitOutcome, Validation


def importance_section(importance: tuple[InputImportance, ...]) -> PageSection | None:
    """Report the influence of each uncertain input on the objective.

    Returns:
        The report section with shares in the variance; None for fewer than two inputs.
    """
    ranked = [entry for entry in importance if math.isfinite(entry.total)]
    if len(ranked) < 2:
        return None
    rows = []
    for entry in ranked:
        shares = ((entry.alone, entry.alone_error), (entry.total, entry.total_error))
        cells = (f"{max(0.0, 100 * share):.1f} % \u00b1 {100 * error:.1f}" for share, error in shares)
        rows.append((entry.name, *cells, "-" if entry.by_gradient is None else f"{100 * entry.by_gradient:.1f} %"))
    note = (
        "Sobol indices with their standard errors. Alone: the mean reduction of the variance of the objective if this "
        "input were known exactly. With all interactions: the remaining variance if all other inputs were known. To "
        "first order: from the derivatives at the given values. The most important input comes first: it is the one to "
        "measure better."
    )
    head = ("uncertain input", "alone", "with all interactions", "to first order")
    table = PageTable(head=head, rows=tuple(rows), note=note, brief=True)
    return PageSection(title="Importance of the uncertain inputs", titled=True, blocks=(table,))


def price_section(design: RobustDesign) -> PageSection | None:
    """Report the benefit of exact knowledge of an uncertain input.

    Returns:
        The report section; None without such inputs.
    """
    if not design.prices:
        return None
    caption = (
        "Left: the optimal gain for each value of an input, and the robust gain. Right: the loss of the robust gain "
        "compared with the optimal gain for that value. The other inputs have their given values."
    )
    note = (
        "The optimal gains for each value ignore the constraints, so part of the loss may be caused by the constraints "
        "of the robust gain. Inputs that were estimated together vary together. Ranges are the possible ranges, or the "
        "middle 98 %."
    )
    name = "Loss of the robust gain over each uncertain input"
    head = ("input", "range", "best gains", "largest loss", "median loss")
    table = PageTable(head=head, rows=tuple(_price_row(p, design.number.unit) for p in design.prices), note=note)
    picture = Picture(figure="price", of=design, name=name, caption=caption)
    return PageSection(title="Value of knowing one input exactly", blocks=(picture, table))


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
    DesignStatus.INFEASIBLE: "infeasible: no gain within the bounds meets every constraint with its probability",
    DesignStatus.NO_CONTACT: "no contact: no gain within the bounds ends in contact as often as the measure requires",
}
_ADVICE: Final = {
    DesignStatus.INFEASIBLE: (
        "No gain within the bounds meets all constraints with their probabilities. Try a smaller probability, a "
        "relaxed limit, another admittance, or less uncertain inputs."
    ),
    DesignStatus.NO_CONTACT: (
        "Some encounters that the measure includes end without contact at every gain. Use a quantile, which excludes a "
        "share of the encounters, or restrict the inputs to values with contact."
    ),
}


def _findings(v: Validation) -> Iterator[str]:
    """State how often random encounters meet each limit."""
    for outcome in v.limits:
        c, p = outcome.required.constraint, outcome.required.probability
        required = "always" if p == 1 else f"{100 * p:g} %"
        label, limit = outcome.limited.words, format_quantity(c.limit, outcome.limited.unit)
        yield (
            f"{label} stays within the limit of {limit} in {share_in_words(outcome.held)} of the fresh samples "
            f"({required} required)"
        )


def robust_page(design: RobustDesign) -> Page:
    """Return the report page of a design for uncertain encounters."""
    advice, v = _ADVICE.get(design.status), design.validation
    premise = Paragraph(
        text="The gain is optimal for the sampled encounters, which are the same for all gains. The distributions of "
        "the inputs are assumptions that this design does not test. If an input is distributed differently, the "
        "probabilities and intervals above are not valid."
    )
    return Page(
        kind="Robust gain for uncertain inputs",
        headline=design.headline,
        status=_STATUS[design.status],
        good=design.status is DesignStatus.OPTIMAL,
        key_figures=() if v is None else tuple(_key_figures(design, v)),
        findings=() if v is None else tuple(_findings(v)),
        next_step=_next_step(design),
        lead="outcome",
        warnings=design.warnings,
        blocks=(
            None if advice is None else Paragraph(text=advice),
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
            method_section(design.method, design.sensor, solved_on=solved_on(design), others=(premise,)),
        ),
    )


def _next_step(design: RobustDesign) -> str:
    if design.status is DesignStatus.NO_CONTACT and design.scenario.relative_velocity > 0:
        uncertain = "obstacle.velocity" in design.uncertainty
        return f"{RECEDING}; change the velocity in [uncertainty] as well" if uncertain else RECEDING
    if design.status is DesignStatus.INFEASIBLE:
        relaxed = step_without_gain(design.problem.task, contact=True, relaxations=design.relaxations)
        return relaxed if isinstance(design.measure, WorstCase) else f"{relaxed}, or require a smaller probability"
    if design.status is DesignStatus.NO_CONTACT:
        return "use a quantile, or restrict the inputs to values with contact"
    return verify_step(design.problem.task, design.gain)


def _section(
    title: str, head: Row, rows: Iterable[Row], note: str, *, wraps: bool = False, opened: bool = False
) -> PageSection:
    table = PageTable(head=head, rows=tuple(rows), note=note, brief=True, wraps=wraps)
    return PageSection(title=title, blocks=(table,), titled=not head, opened=opened)


def _key_figures(design: RobustDesign, v: Validation) -> Iterator[tuple[str, Cell]]:
    label, name, n = design.measure.label, design.nominal_name, design.number
    yield f"robust {n.label}", Measured(design.gain, n.unit)
    yield f"{label} of the objective, fresh samples", Measured(v.value)
    yield f"{name} {n.symbol}", Measured(design.nominal_gain, n.unit)
    if v.nominal is not None:
        yield f"{label} with the {name}", Measured(v.nominal)
    if v.loss is not None:
        yield f"increase with the {name}", _loss(v)


def _loss(v: Validation) -> str:
    if v.loss is None:
        return ""
    error = v.loss.standard_error
    spread = f" \u00b1 {100 * error:.1g}" if math.isfinite(error) else ""
    return f"{100 * v.loss.relative:+.3g}{spread} %"


def _outcome(design: RobustDesign, v: Validation) -> PageSection:
    optimum = f"The {design.nominal_name} is optimal if every input has its given value."
    if design.on_evaluator:
        optimum = f"The {design.nominal_name} is optimal in continuous time, without noise and with the given inputs."
    note = (
        f"The results come from {v.samples} new random encounters, which the design did not use. {optimum} The "
        f"increase of the objective compares the {design.nominal_name} with the robust gain, in the same encounters. "
        "All numbers are predicted, not measured."
    )
    head = (f"on {v.samples} fresh samples ({100 * v.confidence:g} % confidence)", *design.compared)
    return _section("Results on fresh samples", head, _outcome_rows(design, v), note, opened=True)


def _outcome_rows(design: RobustDesign, v: Validation) -> Iterator[Row]:
    """Yield table rows that compare several gains. Compared are the objective and the contact quantities."""
    runs = design.compared.values()
    unbounded = ", the largest of the samples" if v.low == v.value else ""
    interval = f" ({v.low:.4g} to {v.high:.4g})" if math.isfinite(v.high) else unbounded
    values = [float(design.measure.of(run.objective)) for run in runs]
    cells = [Measured(value, suffix="" if i else interval) for i, value in enumerate(values)]
    yield f"{design.measure.label} of the objective", *cells
    if v.loss is not None:
        yield "increase over the robust gain", "", _loss(v), ""
    yield "end in contact", *(share_in_words(float(run.reached.mean())) for run in runs)
    for name in ("relative_velocity", "largest_excursion", "time"):
        for words, share in (("median", 0.5), ("exceeded in 5 %", 0.95)):
            quantiles = (run.reaches(name, share) for run in runs)
            yield f"{words_for(name)}, {words}", *(Measured(value, unit_of(name), 3) for value in quantiles)


def _constraints(v: Validation) -> PageSection:
    note = (
        'The column "at least" shows a lower confidence bound of the probability that an encounter meets the limit. '
        f"The bound is that of Clopper and Pearson, with a confidence of {100 * v.confidence:g} %. "
        '"Demonstrated" means that this bound reaches the required probability. "Within chance" means that the samples '
        "do not contradict the required probability. If the optimum lies on a constraint, new samples often cannot "
        "demonstrate the required probability. In this case, require a slightly larger probability."
    )
    head = ("constraint", "limit", "required in", "met in", "at least", "quantile at the required share", "state")
    return _section("Constraints", head, (_limit_row(o, v) for o in v.limits), note, opened=True)


def _limit_row(outcome: LimitOutcome, v: Validation) -> Row:
    required, unit = outcome.required, outcome.limited.unit
    return (
        named_entry(outcome.limited, magnitude=True),
        Measured(required.constraint.limit, unit),
        "every sample" if required.probability == 1 else f"{100 * required.probability:g} %",
        share_in_words(outcome.held),
        share_in_words(outcome.low),
        Measured(outcome.magnitude, unit),
        v.state_of(outcome),
    )


def _worst(design: RobustDesign) -> PageSection | None:
    """Return the report section about the worst encounter. None unless the design minimized the worst case."""
    w, units = design.worst, input_units(design.sensor)
    if w is None:
        return None
    notes = {1: " (the objective increases with this input)", -1: " (the objective decreases with this input)"}
    rows: tuple[Row, ...] = (
        *((n, Measured(x, units.get(n, ""), suffix=notes.get(w.monotone.get(n, 0), ""))) for n, x in w.inputs.items()),
        ("objective of the worst encounter", Measured(w.value, "", 6)),
        ("upper bound for all encounters", Measured(w.bound, "", 6)),
        ("lower bound for all gains", Measured(w.lower, "", 6)),
        ("boxes of inputs in the search", str(w.boxes)),
    )
    note = (
        "The worst encounter was searched for and bounded, not sampled: no possible encounter exceeds the upper bound."
    )
    return _section("The worst encounter", (), rows, note, wraps=True)


def _uncertain(design: RobustDesign) -> PageSection:
    rows = uncertainty_in_words(design.uncertainty, design.sensor)
    if design.on_evaluator:
        of = "of the sampled loop" if design.method == "loop" else "of the user-defined evaluator, if it has any"
        rows.append(("noise", f"noise {of}, different in each encounter"))
    note = (
        "Inputs are independent of each other unless stated otherwise. All other inputs have their given values, which "
        "are listed below."
    )
    head = ("uncertain input", "distribution")
    return _section("Uncertain inputs", head, rows, note, wraps=True)


def _measure(design: RobustDesign) -> PageSection:
    caption = (
        f"The left plot shows the {design.measure.label} of the objective for each gain. It also shows the objective "
        f"of the {'ideal' if design.on_evaluator else 'nominal'} encounter. Thin gray lines mark gains that violate a "
        "constraint. The right plot shows the cumulative distribution of the objective over the fresh encounters."
    )
    name = "Measure of the objective over the gain, and distribution of the objective"
    rows = tuple(objective_rows(design.definition, design.number))
    terms = PageTable(head=("term of the objective", "typical value", "weight"), rows=rows)
    picture = Picture(figure="robust", of=design, name=name, caption=caption)
    return PageSection(title="The measure over the gain", blocks=(picture, terms))


def _encounters(design: RobustDesign) -> PageSection | None:
    caption = (
        "Cumulative distributions of contact quantities over the fresh encounters. If a curve ends below 100 %, the "
        "other encounters end without contact. Dotted lines are limits and their required probabilities. A quantity "
        "without a curve is always zero."
    )
    if design.status is DesignStatus.NO_CONTACT:
        return None
    picture = Picture(figure="outcome", of=design, name="Distributions of contact quantities", caption=caption)
    return PageSection(title="Distributions of contact quantities", blocks=(picture,))


def _evidence(design: RobustDesign) -> PageSection:
    note = (
        "All gains are compared on the same encounters. The gain is optimal for these encounters; the fresh samples "
        "show its results in other encounters."
    )
    return _section("Evidence", (), _evidence_rows(design), note, wraps=True)


def _evidence_rows(design: RobustDesign) -> Iterator[Row]:
    yield "searched", f"every gain from {format_range(design.bounds, design.number.unit)}"
    if design.strongest not in design.bounds:
        excluded = f"gains stronger than {design.number.text(design.strongest)}: none can be better"
        yield "excluded by a proof", excluded
    yield "scan", f"{design.scanned} gains, each over the same {design.samples} encounters"
    if design.on_evaluator:
        evaluator = "the sampled loop" if design.method == "loop" else f"{design.method}, by the user-defined evaluator"
        text = (
            f"{evaluator}, with the same noise for every gain. The ideal design assumes a controller in continuous "
            "time."
        )
        yield "encounters solved by", text
    yield "local minima found and refined", str(len(design.local_minima))
    yield "seed", str(design.seed)
