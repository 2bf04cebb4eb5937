"""Build the report of a verification: its verdict, the reasons, and suggested improvements."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Final

from pretouch._core.blocks import (
    Cell,
    LazyBlock,
    Listing,
    Measured,
    Page,
    PageSection,
    PageTable,
    Paragraph,
    Picture,
    named,
)
from pretouch._core.units import format_quantity
from pretouch._core.vocabulary import words_for
from pretouch.motion import LawNumber
from pretouch.motion.page_sections import inputs_section, method_section
from pretouch.simulation.closed_loop import loop_section
from pretouch.uncertainty.ensemble import share_in_words, uncertainty_in_words

from .breakage_page import breakage_section
from .effect import VerdictStatus
from .improvement_page import advice_section, changes_section, gain_section
from .result import Comparison, LimitCheck, RunSpread, Verdict
from .stability import StabilityCheck

Row = tuple[Cell, ...]

_WHY: Final = {
    VerdictStatus.HOLDS_NARROWLY: "Why it holds only narrowly",
    VerdictStatus.DOES_NOT_HOLD: "Why it does not hold",
    VerdictStatus.NO_GAIN: "Why it was not verified",
}
_COMPARED: Final = (
    "Predicted: the nominal encounter in continuous time, with a perfect sensor and a robot that follows exactly. "
    "Simulated: those of {runs} on the loop listed below that end in contact. {symbol} = 0: no mitigation, with the "
    "same noise. Largest: until the first contact, except for contact forces. "
    "Simulated and predicted, not measured."
)
_SHARES: Final = (
    "Share of the runs in which a quantity stays below a value, with the gain and without mitigation. Circles: "
    "predicted values, drawn at 50 %. Dotted lines: limits and the required share of the runs. If a curve ends below "
    "100 %, the other runs end without contact. A missing curve means that the quantity is zero in every run."
)
_TWO_RUNS: Final = (
    "Two of the runs until contact, chosen by their speed at contact, and the prediction for the nominal encounter. "
    "If inputs are uncertain, each run is another encounter."
)
_OF_LIMITS: Final = (
    '"At least" is the exact lower confidence bound (Clopper-Pearson, {confidence:g} %) of the probability that the '
    'limit is met. "Shown": this bound reaches the required share. No number of runs can show that a limit is always '
    "met."
)
_STABLE: Final = (
    "The strongest stable gain of the loop, linearized at each distance; half of it; and the verified gain. The "
    "distance with the weakest stable gain is decisive."
)
_OF_CALIBRATION: Final = (
    "Each sensor has a curve, an offset and a misfit that are drawn at random, compatible with the readings of the "
    "calibration. The controller subtracts its configured offset on all of them; the loop runs without noise."
)
_OF_THE_RUNS: Final = (
    "Each run is an independent draw of encounter and noise on the loop listed above. The controller is the same code "
    "that runs on a robot, with its own period. Its readings have the latency, noise and quantization of the sensor "
    "chain.",
    "Robot and contact are integrated by a Runge-Kutta method of order 4; the first contact is located between two "
    "steps.",
    "Other gains and changes are simulated with the same encounters and noise, so that chance largely cancels in "
    "differences; the standard error describes the remaining uncertainty.",
    "Stability is computed from the eigenvalues of the exactly discretized linear loop at each distance.",
)

_FEW: Final = 4  # key figures that a summary prints


def verdict_page(verdict: Verdict) -> Page:
    """Return the report page on the verification of a gain."""
    v = verdict
    return Page(
        kind="Does the gain hold on the simulated loop?",
        headline=v.headline,
        status=v.status.value.replace("-", " "),
        good=v.status.is_passed,
        key_figures=tuple(_key_figures(v)),
        warnings=v.warnings,
        findings=tuple(_findings(v)),
        next_step="" if v.advice is None else v.advice.sentence,
        lead="verdict_run",
        blocks=(
            Paragraph(text=v.status.meaning, quiet=True),
            _reasons(v),
            advice_section(v),
            _comparison(v),
            _limits(v),
            LazyBlock(make=partial(_stability, v), brief=True),
            breakage_section(v.breakage),
            _calibration(v),
            gain_section(v),
            changes_section(v),
            _list_chapter("Assumptions", v.assumptions),
            loop_section(v.loop),
            inputs_section(v.scenario, v.sensor),
            _uncertain(v),
            _method(v),
        ),
    )


def _key_figures(v: Verdict) -> Iterator[tuple[str, Cell]]:
    if v.gain is None:
        return
    figures = [*_main_figures(v)]
    yield from figures
    # The rates take long to compute, and the section on stability has them, too.
    if v.stability is not None and len(figures) < _FEW:
        yield _rates_figure(v.stability)


def _main_figures(v: Verdict) -> Iterator[tuple[str, Cell]]:
    ideal, n = v.design.gain, v.law.number
    best = "the ideal optimum" if ideal == v.gain else "no ideal one" if ideal is None else f"ideal {n.text(ideal)}"
    yield f"verified {n.label}; {best}", Measured(v.gain, n.unit)
    for name in ("relative_velocity", "impact_force", "peak_force"):
        c = v.comparison(name)
        if c is not None:
            shown = (("predicted", c.predicted), ("unmitigated", _mean(c.unmitigated)))
            others = [f"{text} {format_quantity(value, c.unit, 3)}" for text, value in shown if value is not None]
            yield "; ".join([f"mean {c.label}", *others]), Measured(_mean(c.simulated), c.unit, 3)
    check = v.stability
    if check is None:
        yield "gain margin", "not known"
        return
    margin = "always stable" if math.isinf(check.margin) else f"{check.margin:.3g}"
    yield f"gain margin; unstable beyond {_strongest(check, n)}", margin


def _rates_figure(check: StabilityCheck) -> tuple[str, Cell]:
    least = (
        "none is enough" if math.isinf(check.lowest_rate_for_margin_2) else f"{check.lowest_rate_for_margin_2:.3g} Hz"
    )
    name = (
        f"sensor rate above which this gain is stable; sensor rate for a gain margin of 2: {least}; sensor rate in "
        f"the simulation: {check.rate:.3g} Hz"
    )
    return name, _rate(check.lowest_rate)


def _findings(v: Verdict) -> Iterator[str]:
    """Yield further reasons against the gain, then the limits it meets."""
    yield from v.reasons[1:]
    for c in v.limits:
        if c.is_met and not any(c.statement in reason for reason in v.reasons):
            share, p = share_in_words(c.held), c.required.probability
            required = "every run" if p == 1 else f"{100 * p:g} %"
            free = c.name == "impact_force" and v.loop.contact is None
            only = (
                "; a drive or a wall that pushes during the impact adds to it: simulate it with [contact]"
                if free
                else ""
            )
            yield (
                f"{c.label} within {format_quantity(c.limit, c.unit)} in {share} of {_runs(v)} ({required} required)"
                f"{only}"
            )
    if v.breakage is not None and not v.breakage.harder:  # otherwise, a warning says so
        yield v.breakage.text


def _strongest(check: StabilityCheck, number: LawNumber) -> str:
    return number.text(check.strongest) if math.isfinite(check.strongest) else "-\u221e"[number.sign > 0 :]


def _rate(rate: float) -> Cell:
    if rate == 0:
        return "any"
    return "none is enough" if math.isinf(rate) else Measured(rate, "Hz", 3)


def _list_chapter(title: str, sentences: tuple[str, ...]) -> PageSection | None:
    blocks = (Listing(items=sentences, brief=True),)
    return PageSection(title=title, titled=True, blocks=blocks, opened=title in _WHY.values()) if sentences else None


def _reasons(v: Verdict) -> PageSection | None:
    if v.gain is not None or not v.reasons:
        return _list_chapter(_WHY.get(v.status, ""), v.reasons)
    step = "" if v.advice is None else f" {v.advice.sentence[:1].upper()}{v.advice.sentence[1:]}."
    tried = f"Nothing was simulated.{step}"
    n = v.law.number
    head = ("limit", "at most", "best value of any gain", f"at {n.symbol}")
    rows: tuple[Row, ...] = tuple(
        (
            n.entry(c.quantity).words,
            *(Measured(x, c.unit) for x in (c.limit, c.best_value)),
            Measured(c.best_gain, n.unit),
        )
        for c in v.design.constraints
    )
    limits = PageTable(head=head, rows=rows) if rows else None
    blocks = (Listing(items=v.reasons, brief=True), Paragraph(text=tried), limits)
    return PageSection(title=_WHY[v.status], titled=True, blocks=blocks, opened=True)


def _comparison(v: Verdict) -> PageSection | None:
    if v.reached is None or v.mitigated is None or v.unmitigated is None:
        return None
    symbol = v.law.number.symbol
    free = (f"predicted, {symbol} = 0", f"mean, {symbol} = 0")
    head = ("", "predicted", "mean of the runs", "5 % to 95 %", "worst", *free)
    note = _COMPARED.format(runs=_runs(v), symbol=symbol)
    table = PageTable(head=head, rows=tuple(map(_comparison_row, v.comparisons)), note=note, brief=True)
    shares = Picture(
        figure="verdict", of=v, name="Share of runs in which each quantity stays below a value", caption=_SHARES
    )
    name = "Distance and relative velocity of two runs over time, with the prediction"
    runs = Picture(figure="verdict_run", of=v, name=name, caption=_TWO_RUNS)
    touched = v.mitigated.touched.any() or v.unmitigated.touched.any()
    blocks = (table, Paragraph(text=_reached(v)), shares if touched else None, runs)
    return PageSection(title="Predicted and simulated", blocks=blocks)


def _runs(v: Verdict) -> str:
    return f"{v.runs} run{'' if v.runs == 1 else 's'}"


def _comparison_row(c: Comparison) -> Row:
    s = c.simulated
    return (
        named(c.name, magnitude=c.name == "relative_velocity"),
        Measured(c.predicted, c.unit),
        Measured(_mean(s), c.unit),
        Measured(None) if s is None else _between(s, c.unit),
        Measured(None if s is None else s.worst, c.unit),
        Measured(c.predicted_unmitigated, c.unit),
        Measured(_mean(c.unmitigated), c.unit),
    )


def _mean(spread: RunSpread | None) -> float | None:
    return None if spread is None else spread.mean


def _between(spread: RunSpread, unit: str) -> str:
    low, high = (format_quantity(x, unit, 3) for x in (spread.low, spread.high))
    (first, own), (last, other) = low.partition(" ")[::2], high.partition(" ")[::2]
    return f"{first} to {last} {other}".strip() if own == other else f"{low} to {high}"


def _reached(v: Verdict) -> str:
    """Return a sentence on how many simulated runs end in contact."""
    if v.reached is None:
        return ""
    text = (
        f"Contact is predicted in {share_in_words(v.reached.predicted)} of the encounters. In the simulation "
        f"({_runs(v)}), contact occurs in {share_in_words(v.reached.simulated)} of the runs"
    )
    text += f"; {v.reached.missing} end without the predicted contact." if v.reached.missing else "."
    if v.reached.low is not None:
        text += (
            " If contact is predicted, it also occurs on the simulated loop with a probability of at least "
            f"{share_in_words(v.reached.low)} ({100 * v.confidence:g} % confidence)."
        )
    return text


def _limits(v: Verdict) -> PageSection | None:
    if not v.limits:
        return None
    first = ("limit", "at most", "required in", "met in", "at least")
    head = (*first, "predicted", "quantile", "margin", "state")
    sources = (f" {c.label.capitalize()}: {c.source}." for c in v.limits if c.source != "simulated")
    note = _OF_LIMITS.format(confidence=100 * v.confidence) + "".join(sources)
    table = PageTable(head=head, rows=tuple(map(_limit_row, v.limits)), note=note, brief=True)
    return PageSection(title="Limits", blocks=(table,), opened=True)


def _limit_row(check: LimitCheck) -> Row:
    p, unit = check.required.probability, check.unit
    state = "met in every run" if p == 1 else "shown" if check.low >= p else "met, not shown"
    return (
        check.label,
        Measured(check.limit, unit),
        "every run" if p == 1 else f"{100 * p:g} %",
        share_in_words(check.held),
        share_in_words(check.low),
        *(Measured(value, unit) for value in (check.predicted, check.value, check.margin)),
        state if check.is_met else "MISSED",
    )


def _stability(v: Verdict) -> PageSection | None:
    if not v.stability_text:
        return None
    check, title = v.stability, "Is the sensor fast enough, and is the loop stable?"
    said = v.stability_text if v.sensor_speed is None else f"{v.sensor_speed.text} {v.stability_text}"
    text = Paragraph(text=said, brief=True)
    if check is None:
        return PageSection(title=title, blocks=(text,))
    name = "Strongest stable gain over the distance"
    picture = Picture(figure="verdict_stability", of=v, name=name, caption=_STABLE)
    shown = picture if math.isfinite(check.strongest) and check.strongest != 0 else None
    return PageSection(title=title, blocks=(text, PageTable(rows=tuple(_stability_rows(check))), shown))


def _stability_rows(check: StabilityCheck) -> Iterator[Row]:
    yield "gain margin", Measured(check.margin)
    yield "strongest stable gain", Measured(check.strongest, check.limit.law.number.unit)
    if math.isfinite(check.strongest):
        yield "at the critical distance", Measured(check.critical_distance, "m")
    if math.isfinite(check.frequency):
        yield "oscillation frequency at the limit", Measured(check.frequency, "Hz")
    yield "sensor rate", Measured(check.rate, "Hz")
    yield "lowest sensor rate for a stable loop", _rate(check.lowest_rate)
    yield "lowest sensor rate for a gain margin of 2", _rate(check.lowest_rate_for_margin_2)


def _calibration(v: Verdict) -> PageSection | None:
    check = v.calibration_check
    if check is None:
        return None
    shares = (("5 % quantile", check.low), ("median", check.median), ("95 % quantile", check.high))
    rows: tuple[Row, ...] = (
        (f"{words_for('relative_velocity')} on the fitted curve", Measured(check.predicted, "m/s")),
        *((f"{name} over the drawn sensors", Measured(x, "m/s")) for name, x in shares if x is not None),
        ("sensors with a contact more than 15 % harder", f"{check.harder_count} of {check.draws}"),
        ("sensors that miss a limit which the fitted curve meets", f"{check.broken} of {check.draws}"),
        ("sensors without contact", f"{check.missing} of {check.draws}"),
    )
    text = Paragraph(text=check.text, brief=True)
    return PageSection(
        title="Is the calibration good enough?", blocks=(text, PageTable(rows=rows, note=_OF_CALIBRATION))
    )


def _uncertain(v: Verdict) -> PageSection | None:
    rows = tuple(uncertainty_in_words(v.uncertainty, v.sensor))
    note = "Encounter and sensor are listed above with their nominal values."
    table = PageTable(head=("input", "distribution"), rows=rows, wraps=True, note=note)
    return PageSection(title="What is uncertain", blocks=(table,)) if rows else None


def _method(v: Verdict) -> PageSection:
    runs = PageSection(title="Of the runs", blocks=(Listing(items=_OF_THE_RUNS),))
    prediction = replace(method_section(v.design.method), title="Of the prediction")
    return PageSection(title="Method and assumptions", blocks=(runs, prediction))
