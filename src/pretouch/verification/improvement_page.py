"""What a verdict says of what could be better: the one change that helps most, all that was tried, the best gain."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from pretouch._core.blocks import Cell, Chapter, Measured, Paragraph, Picture, Rows
from pretouch._core.vocabulary import words_for
from pretouch.design.page import objective_rows

from .improvement import LoopChange, Loss
from .result import Verdict

Row = tuple[Cell, ...]

_MARGIN: Final = 2.0  # to instability: the usual 6 dB
_ERRORS: Final = 2.0  # standard errors, below which a difference is no more than chance
_KEPT: Final = 1 - 1e-12
_HELPS: Final = (
    " A change helps if it turns the status to the better by limits, effect and margin; or if what is missed most is "
    "missed less often, by more than chance; or, with nothing missed more often and a margin of 2 to instability kept, "
    "if the objective falls by more than chance and by enough to be worth the effort; never if the loop is unstable "
    "with it. Objective: its mean change with the standard error. Limits kept: whether every limit held as often as it "
    "must, contact came and was softer than without mitigation, and the loop is stable; where a limit was missed, also "
    "in how many of the runs the limit holds that was missed most."
)


def best_change_section(v: Verdict) -> Chapter | None:
    """Describe the one change that helps most: each effect as it is, and with the change; None where none was tried."""
    if not v.changes:
        return None
    best, rate = v.best_change, _rate_in_words(v)
    if best is None:
        text = (
            "None of the changes that were tried turns the status to the better, or helps by more than chance and 1 % "
            f"of the objective. {rate}"
        ).strip()
        return Chapter(title="No change helps", titled=True, blocks=(Paragraph(text=text, brief=True),))
    title = "What would help most" + ("" if best.standing >= _KEPT else ", though it alone is not enough")
    effects = Rows(head=("", "as it is", "with the change"), rows=tuple(_effects(v, best)))
    said = Paragraph(text=f"{best.sentence} {rate}".strip(), brief=True)
    return Chapter(title=title, titled=True, blocks=(said, effects))


def _rate_in_words(v: Verdict) -> str:
    """Say which rate of the sensor the gain asks for, where its margin is below 2 and no change is enough."""
    check, best = v.stability, v.best_change
    enough = best is not None and best.standing >= 1 and (best.margin is None or best.margin >= _MARGIN)
    if check is None or check.margin >= _MARGIN or enough:
        return ""
    gain = f"With {v.law.number.equals(v.gain or 0.0)}"
    if math.isfinite(check.lowest_rate_with_margin):
        return (
            f"{gain} the sensor would have to be read {check.lowest_rate_with_margin:.3g} times a second for a margin "
            "of 2 to instability."
        )
    text = f"{gain} no rate of the sensor is high enough for a margin of 2 to instability"
    if math.isfinite(check.lowest_rate):
        text += f", {check.lowest_rate:.3g} times a second at the limit"
    return f"{text}: delay, filters or robot forbid it."


def _effects(v: Verdict, change: LoopChange) -> Iterator[Row]:
    if change.gain != v.gain:
        n = v.law.number
        yield n.label, Measured(v.gain, n.unit), Measured(change.gain, n.unit)
    if change.held is not None:
        same = v.as_it_is[-1 if change.name == "gain" else 0].held  # over the same runs
        yield _missed_most(v), Measured(None) if same is None else _percent(same), _percent(change.held)
    if v.effect is not None and v.effect.is_harder and change.standing >= _KEPT:
        yield "contact harder than without mitigation", "yes", "no"
    if v.effect is not None and v.effect.is_absent and change.standing >= _KEPT:
        yield "contact softer than without mitigation", "no", "yes"
    if change.margin is not None and v.stability is not None:
        yield "margin to instability", _times(v.stability.margin), _times(change.margin)
    if change.objective is not None and change.improvement is not None:
        # over the runs that the change was compared by, which are not all
        before = change.objective / (1 - change.improvement) if change.improvement < 1 else None
        yield "objective", Measured(before), Measured(change.objective, beside=f" ({_objective_change(change)})")


def _missed_most(v: Verdict) -> str:
    """Name what is missed most compared with what is required."""
    shares: list[tuple[float, str]] = []
    if v.reached is not None and v.reached.missing:
        shares.append((1 - v.reached.missing / round(v.reached.predicted * v.runs), "contact comes in"))
    shares += [(c.held / c.required.probability, f"{c.statement} holds in") for c in v.limits if not c.is_met]
    # else it is missed in the runs that changes are compared by, and not in all
    return min(shares)[1] if shares else "what is missed most holds in"


def changes_section(v: Verdict) -> Chapter | None:
    """Describe every change that was tried, the most helpful first; None where none was."""
    if not v.changes:
        return None
    n = v.compared_runs
    note = f"Each was simulated on the same {n} run{'' if n == 1 else 's'}: the same encounters with the same noise"
    note += f", the first of the {v.runs}; another gain on all {v.runs}" if n < v.runs else ""
    head = ("change", "objective", "limits kept", "margin", "what to do")
    rows = (*_rows_as_it_is(v), *map(_change_row, v.changes))
    table = Rows(head=head, rows=rows, note=f"{note}.{_HELPS}", wraps=True, brief=True)
    return Chapter(title="What was tried", titled=True, blocks=(table,))


def _rows_as_it_is(v: Verdict) -> Iterator[Row]:
    """Yield the loop without a change, over the runs that the changes are compared by, and over all."""
    for one, runs in zip(v.as_it_is, (v.compared_runs, v.runs), strict=False):
        of = f", {runs} run{'' if runs == 1 else 's'}" if len(v.as_it_is) > 1 else ""
        told = "Nothing is changed." if runs == v.compared_runs else "Compare another gain with this row."
        yield f"as it is{of}", "", _kept_cell(one), _margin_cell(one), told


def _change_row(change: LoopChange) -> Row:
    name = f"{words_for(change.name)}{': helps' if change.helps else ''}"
    return name, _objective_change(change), _kept_cell(change), _margin_cell(change), change.sentence


def _kept_cell(change: LoopChange) -> str:
    kept = "all" if change.standing >= _KEPT else "not all"
    return kept if change.held is None else f"{kept}: {_percent(change.held)}"


def _margin_cell(change: LoopChange) -> str:
    return "-" if change.margin is None else _times(change.margin)


def _times(margin: float) -> str:
    return "\u221e" if math.isinf(margin) else f"\u00d7 {margin:.3g}"


def _percent(share: float) -> str:
    return f"{100 * share:.4g} %"


def _objective_change(change: LoopChange) -> str:
    if change.improvement is None:
        return "-"
    return _percent_with_error(-100 * change.improvement, 100 * (change.improvement_error or 0.0))


def _percent_with_error(value: float, error: float) -> str:
    digits = 1 if error >= 1 else 2
    if max(abs(value), error) < 0.5 * 0.1**digits:  # nothing that is shown: no sign either
        return "0 %"
    return f"{value:+.{digits}f}" + (f" \u00b1 {error:.{digits}f} %" if error else " %")


def gain_section(v: Verdict) -> Chapter:
    """Describe the objective over the gain, and what the verified one costs beside the best one on this loop."""
    tried = v.loss is not None
    caption = "The objective of the nominal encounter in continuous time (ideal)"
    caption += ", and its mean over the runs on the loop, as far as gains were tried there" if tried else ""
    caption += ". Thin and grey: gains that miss a limit"
    caption += ", or make contact no softer than without mitigation." if tried else "."
    name = "Objective over the gain, in the ideal world and on the loop"
    known = [v.design.trade_off.objective, *([] if v.loss is None else [v.loss.curve.objective])]
    picture = Picture(figure="verdict_gain", of=v, name=name, caption=caption)
    terms = Rows(head=("term of the objective", "typical value", "weight"), rows=tuple(objective_rows(v.definition)))
    shown = picture if any(np.isfinite(objective).any() for objective in known) else None
    title = "The objective over the gain" if v.gain is None else "The gain on this loop"
    return Chapter(title=title, blocks=(*_gain_blocks(v), shown, terms))


def _gain_blocks(v: Verdict) -> Iterator[Paragraph | Rows]:
    if v.loss is not None:
        yield Paragraph(text=_loss_in_words(v, v.loss), brief=True)
    rows = tuple(_loss_rows(v))
    if rows:
        head = ("", v.law.number.label, f"objective ({v.definition.name})")
        yield Rows(head=head, rows=rows, brief=v.loss is not None)


def _loss_in_words(v: Verdict, loss: Loss) -> str:
    best = _best_gain_in_words(loss)
    if loss.loop_gain is None:
        return f"{best[0].upper()}{best[1:]}, keeping every limit: none."
    best = f"the {best}, {v.law.number.text(loss.loop_gain)}"
    if loss.loss is None or loss.loop_objective is None:
        return f"A run ends without contact, so that nothing is said of the cost beside {best}."
    share, error = 100 * loss.loss / loss.loop_objective, 100 * (loss.loss_error or 0.0) / loss.loop_objective
    apart = _percent_with_error(share, error)
    if share > max(_ERRORS * error, 0.0):
        return f"The verified gain costs {share:.3g} % of the objective ({apart}) beside {best}."
    lacks = _lacks_in_words(v) if share < -_ERRORS * error else ""
    if lacks:
        return f"By the objective the verified gain is {-share:.3g} % better ({apart}) than {best}, but {lacks}."
    return f"The verified gain costs no more than chance of the objective ({apart}) beside {best}."


def _best_gain_in_words(loss: Loss) -> str:
    """Say among which gains the best one on the loop was sought."""
    if loss.sought_margin is None:
        return "best gain on this loop"
    if loss.sought_margin >= _MARGIN:
        return f"best gain on this loop with a margin of {loss.sought_margin:g} to instability"
    return "best stable gain on this loop, where none within the bounds has a margin of 2 to instability"


def _lacks_in_words(v: Verdict) -> str:
    """Say what the verified gain lacks that the best one on the loop has; a search over fewer runs cannot tell more."""
    check, loss = v.stability, v.loss
    if not all(limit.is_met for limit in v.limits):
        return "it misses a limit"
    if v.effect is not None and (v.effect.is_harder or v.effect.is_absent):
        return "it makes contact no softer than without mitigation"
    if check is not None and loss is not None and check.margin < (loss.sought_margin or 0.0):
        return f"its margin to instability is only {check.margin:.3g}"
    return ""


def _loss_rows(v: Verdict) -> Iterator[Row]:
    design, loss, unit = v.design, v.loss, v.law.number.unit
    if design.gain is not None:
        yield "ideal optimum, predicted", Measured(design.gain, unit), Measured(design.objective, "", 5)
    if loss is None or v.gain is None:
        return
    own = Measured(v.gain, unit)
    if v.gain != design.gain:
        yield "verified gain, predicted", own, Measured(loss.predicted, "", 5)
    error = f" \u00b1 {loss.standard_error:.1g}" if loss.standard_error else ""
    yield "verified gain, mean of the runs", own, Measured(loss.objective, "", 5, error)
    if loss.loop_gain is not None:
        name = f"{_best_gain_in_words(loss)}, mean of the runs"
        yield name, Measured(loss.loop_gain, unit), Measured(loss.loop_objective, "", 5)
