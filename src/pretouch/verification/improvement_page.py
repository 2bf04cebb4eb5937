"""Build the report sections on better gains and loop changes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from pretouch._core.blocks import Cell, LazyBlock, Measured, PageSection, PageTable, Paragraph, Picture
from pretouch._core.vocabulary import words_for
from pretouch.designs.page import objective_rows

from .appraisal import USUAL_MARGIN
from .effect import SIGNIFICANT
from .improvement import LoopChange, Loss
from .result import Verdict

Row = tuple[Cell, ...]

_KEPT: Final = 1 - 1e-12
_HELPS: Final = (
    " A change helps in three cases: the status improves, as judged by limits, contact speed and gain margin; the most "
    "missed limit is missed significantly less often; or the objective falls significantly and by at least 1 %, while "
    "no limit is missed more often and the gain margin is at least 2 or does not fall. A change that makes the loop "
    "unstable never helps. Objective: mean change with its standard error. Limits met: whether every limit is met as "
    "often as required, contact happens and is softer than without mitigation, and the loop is stable; the percentage "
    "is that of the most missed limit. Prediction, sensor speed and calibration are not checked for a change."
)


def advice_section(v: Verdict) -> PageSection | None:
    """Return the report section on what to do next, and on the single change that helps most.

    None if no change was tried.
    """
    if not v.changes:
        return None
    best, rate = v.best_change, _rate_in_words(v)
    title = "What to do next"
    advice = [] if v.advice is None else [_as_sentence(v.advice.sentence)]
    if best is None:
        if not advice:
            title = "No change helps"
            advice.append(
                "None of the tried changes improves the result of the verification. None lowers the objective "
                "significantly and by at least 1 %."
            )
        text = " ".join([*advice, rate]).strip()
        return PageSection(title=title, titled=True, blocks=(Paragraph(text=text, brief=True),), opened=True)
    open_reasons = _reasons_not_checked(v)
    enough = "" if best.standing >= _KEPT else ", which is not enough alone"
    effects = PageTable(head=("", "now", "with the change"), rows=tuple(_effects(v, best)))
    unchecked = f"Not checked with this change: whether {' and '.join(open_reasons)}." if open_reasons else ""
    single = f"The single change that helps most{enough}: {best.sentence}"
    if advice and advice[0].startswith(best.sentence.removesuffix(".")):  # the advice is this change, with its verdict
        single = unchecked = ""
    text = " ".join(text for text in (*advice, single, rate, unchecked) if text)
    return PageSection(title=title, titled=True, blocks=(Paragraph(text=text, brief=True), effects), opened=True)


def _as_sentence(step: str) -> str:
    return f"{step[:1].upper()}{step[1:].removesuffix('.')}."


def _reasons_not_checked(v: Verdict) -> list[str]:
    """List the known problems that were not checked with the change."""
    effect, speed, calibration = v.effect, v.sensor_speed, v.calibration_check
    excess = None if effect is None else effect.excess
    report = v.design.problem.task.calibration
    clauses = (
        (excess is not None and excess > v.speed_tolerance, "the contact speed is still higher than predicted"),
        (speed is not None and not speed.is_fast_enough, "the sensor is still too slow"),
        (
            (calibration is not None and not calibration.is_good_enough)
            or (report is not None and report.verdict != "usable"),
            "the calibration is good enough",
        ),
    )
    return [clause for applies, clause in clauses if applies]


def _rate_in_words(v: Verdict) -> str:
    """State the rate for a gain margin of 2; empty if the margin is that large, or if a change is enough."""
    check, best = v.stability, v.best_change
    enough = best is not None and best.standing >= 1 and (best.margin is None or best.margin >= USUAL_MARGIN)
    if check is None or check.margin >= USUAL_MARGIN or enough:
        return ""
    gain = v.law.number.equals(v.gain or 0.0)
    if math.isfinite(check.lowest_rate_for_margin_2):
        rate, task = check.lowest_rate_for_margin_2, v.design.problem.task
        text = f"For a control law with {gain}, a gain margin of 2 needs a sensor rate of {rate:.3g} Hz"
        if rate > task.largest_sensor_rate:
            text += f", but the {task.sensor_part.name} reaches at most {task.largest_sensor_rate:g} Hz"
        return f"{text}."
    text = f"With {gain}, no sensor rate results in a gain margin of 2: latency, filters or robot are too slow"
    if math.isfinite(check.lowest_rate):
        text += f". Stability needs {check.lowest_rate:.3g} Hz"
    return f"{text}."


def _effects(v: Verdict, change: LoopChange) -> Iterator[Row]:
    if change.gain != v.gain:
        n = v.law.number
        yield n.label, Measured(v.gain, n.unit), Measured(change.gain, n.unit)
    if change.held is not None:
        same = v.unchanged[-1 if change.name == "gain" else 0].held  # over the same runs
        yield _missed_most(v), Measured(None) if same is None else _percent(same), _percent(change.held)
    if v.effect is not None and v.effect.is_harder and change.standing >= _KEPT:
        yield "contact harder than without mitigation", "yes", "no"
    if v.effect is not None and v.effect.is_absent and change.standing >= _KEPT:
        yield "contact softer than without mitigation", "no", "yes"
    if change.margin is not None and v.stability is not None:
        yield "gain margin", _times(v.stability.margin), _times(change.margin)
    if change.objective is not None and change.improvement is not None:
        # the share over the runs on which the change was compared, not over all runs
        before = change.objective / (1 - change.improvement) if change.improvement < 1 else None
        yield "objective", Measured(before), Measured(change.objective, suffix=f" ({_objective_change(change)})")


def _missed_most(v: Verdict) -> str:
    """Name the requirement that is missed most often."""
    shares: list[tuple[float, str]] = []
    if v.reached is not None and v.reached.missing:
        shares.append((1 - v.reached.missing / round(v.reached.predicted * v.runs), "runs with the predicted contact"))
    shares += [(c.held / c.required.probability, f"runs with {c.statement}") for c in v.limits if not c.is_met]
    # Without an entry, the limit is missed on the compared runs, but not over all runs.
    return min(shares)[1] if shares else "runs that meet the most missed limit"


def changes_section(v: Verdict) -> PageSection | None:
    """Return the report section on all tried changes.

    None if no change was tried.
    """
    if not v.changes:
        return None
    n = v.compared_runs
    runs = "1 run" if n == 1 else f"{n} runs"
    note = f"Each change was simulated in {runs}, with the same encounters and noise."
    if n < v.runs:
        note += f" The verification has {v.runs} runs in total. Changes of the gain were simulated in all runs."
    head = ("change", "objective", "limits met", "gain margin", "what to do")
    rows = (*_rows_as_it_is(v), *map(_change_row, v.changes))
    table = PageTable(head=head, rows=rows, note=note + _HELPS, wraps=True, brief=True)
    return PageSection(title="Tried changes", titled=True, blocks=(table,))


def _rows_as_it_is(v: Verdict) -> Iterator[Row]:
    """Yield table rows with the results of the unchanged loop."""
    for one, runs in zip(v.unchanged, (v.compared_runs, v.runs), strict=False):
        of = f", {runs} run{'' if runs == 1 else 's'}" if len(v.unchanged) > 1 else ""
        text = "Compare changes with this row." if runs == v.compared_runs else "Compare another gain with this row."
        yield f"unchanged{of}", "", _kept_cell(one), _margin_cell(one), text


def _change_row(change: LoopChange) -> Row:
    name = f"{words_for(change.name)}{': helps' if change.helps else ''}"
    return name, _objective_change(change), _kept_cell(change), _margin_cell(change), change.sentence


def _kept_cell(change: LoopChange) -> str:
    kept = "all" if change.standing >= _KEPT else "not all"
    return kept if change.held is None else f"{kept}: {_percent(change.held)}"


def _margin_cell(change: LoopChange) -> str:
    return "-" if change.margin is None else _times(change.margin)


def _times(margin: float) -> str:
    return "\u221e" if math.isinf(margin) else f"{margin:.3g}"


def _percent(share: float) -> str:
    return f"{100 * share:.4g} %"


def _objective_change(change: LoopChange) -> str:
    if change.improvement is None:
        return "-"
    return _percent_with_error(-100 * change.improvement, 100 * (change.improvement_error or 0.0))


def _percent_with_error(value: float, error: float) -> str:
    digits = 1 if error >= 1 else 2
    if max(abs(value), error) < 0.5 * 0.1**digits:  # rounds to 0, which is shown without a sign
        return "0 %"
    return f"{value:+.{digits}f}" + (f" \u00b1 {error:.{digits}f} %" if error else " %")


def gain_section(v: Verdict) -> PageSection:
    """Return the report section on the objective as a function of gain.

    The verified gain is compared with the best gain on the simulated loop.
    """
    tried = v.loss is not None
    caption = "The objective of the nominal encounter in continuous time (ideal)"
    caption += ", and its mean over the runs on the loop for the tried gains" if tried else ""
    caption += ". Thin gray lines are gains that miss a limit"
    caption += ", or make contact no softer than without mitigation." if tried else "."
    name = "Objective over the gain, in continuous time and on the loop"
    picture = Picture(figure="verdict_gain", of=v, name=name, caption=caption)
    rows = tuple(objective_rows(v.definition, v.law.number))
    terms = PageTable(head=("term of the objective", "typical value", "weight"), rows=rows)

    def shown() -> Picture | None:
        objectives = [v.design.trade_off.objective, *([] if v.loss is None else [v.loss.curve.objective])]
        return picture if any(np.isfinite(objective).any() for objective in objectives) else None

    title = "The objective over the gain" if v.gain is None else "The gain on the simulated loop"
    return PageSection(title=title, blocks=(*_gain_blocks(v), LazyBlock(make=shown), terms))


def _gain_blocks(v: Verdict) -> Iterator[Paragraph | PageTable]:
    if v.loss is not None:
        yield Paragraph(text=_loss_in_words(v, v.loss), brief=True)
    rows = tuple(_loss_rows(v))
    if rows:
        head = ("", v.law.number.label, f"objective ({v.definition.name})")
        yield PageTable(head=head, rows=rows, brief=v.loss is not None)


def _loss_in_words(v: Verdict, loss: Loss) -> str:
    best = _best_gain_in_words(loss)
    if loss.loop_gain is None:
        return "No gain was found that meets every limit on the simulated loop."
    best = f"the {best}, {v.law.number.text(loss.loop_gain)}"
    if loss.loss is None or loss.loop_objective is None:
        return (
            f"The objective of the verified gain cannot be compared with that of {best}, because at least one "
            "simulated run ends without contact."
        )
    share, error = 100 * loss.loss / loss.loop_objective, 100 * (loss.loss_error or 0.0) / loss.loop_objective
    apart = _percent_with_error(share, error)
    if share > max(SIGNIFICANT * error, 0.0):
        return f"Compared with {best}, the objective of the verified gain is {share:.3g} % worse (difference: {apart})."
    lacks = _lacks_in_words(v) if share < -SIGNIFICANT * error else ""
    if lacks:
        text = (
            f"Compared with {best}, the objective of the verified gain is {-share:.3g} % better (difference: {apart})."
        )
        return f"{text} However, the verified gain has a disadvantage: {lacks}."
    return f"Compared with {best}, the objective of the verified gain is not significantly worse (difference: {apart})."


def _best_gain_in_words(loss: Loss) -> str:
    """Return a label for the best gain and its margin."""
    if loss.sought_margin is None:
        return "best gain on the simulated loop"
    if loss.sought_margin >= USUAL_MARGIN:
        return f"best gain with a gain margin of {loss.sought_margin:g} on the simulated loop"
    return "best stable gain on the simulated loop (none within the bounds has a gain margin of 2)"


def _lacks_in_words(v: Verdict) -> str:
    """Name the requirement that only the verified gain misses."""
    check, loss = v.stability, v.loss
    if not all(limit.is_met for limit in v.limits):
        return "it misses a limit"
    if v.effect is not None and (v.effect.is_harder or v.effect.is_absent):
        return "it makes contact no softer than without mitigation"
    if check is not None and loss is not None and check.margin < (loss.sought_margin or 0.0):
        return f"its gain margin is only {check.margin:.3g}"
    return ""


def _loss_rows(v: Verdict) -> Iterator[Row]:
    design, loss, unit = v.design, v.loss, v.law.number.unit
    if design.gain is not None:
        yield "ideal optimum, predicted", Measured(design.gain, unit), Measured(design.objective, "", 5)
    if loss is None or v.gain is None:
        return
    verified = Measured(v.gain, unit)
    if v.gain != design.gain:
        yield "verified gain, predicted", verified, Measured(loss.predicted, "", 5)
    error = f" \u00b1 {loss.standard_error:.1g}" if loss.standard_error else ""
    yield "verified gain, mean of the runs", verified, Measured(loss.objective, "", 5, error)
    if loss.loop_gain is not None:
        name = f"{_best_gain_in_words(loss)}, mean of the runs"
        yield name, Measured(loss.loop_gain, unit), Measured(loss.loop_objective, "", 5)
