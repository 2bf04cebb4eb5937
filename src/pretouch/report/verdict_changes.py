"""What a verdict says of what could be better: the one change that helps most, all that was tried, the best gain."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

from pretouch.verification import Change, Verdict
from pretouch.verification.wording import best_gain_in_words, lacks_in_words, rate_in_words

from .wording import number, quantity

__all__ = ["change_box", "change_note", "change_rows", "loss_rows", "loss_text"]

Row = tuple[str, ...]

_DASH: Final = "\u2013"
_ERRORS: Final = 2.0  # standard errors, below which a difference is no more than chance
_KEPT: Final = 1 - 1e-12


def change_box(v: Verdict) -> dict[str, Any]:
    """Collect what is said of the one change that helps most.

    Args:
        v: the verdict.

    Returns:
        `title`, `text` and `rows`: each effect as it is and with the change; empty where nothing was tried.
    """
    if not v.changes:
        return {}
    best = v.best_change
    if best is None:
        text = f"None of the changes that were tried helps by more than chance. {rate_in_words(v)}".strip()
        return {"title": "No change helps", "text": text, "rows": [], "enough": True}
    enough = best.standing >= _KEPT
    title = "The one change that would help most" + ("" if enough else ", though it alone is not enough")
    text = f"{best.sentence} {rate_in_words(v)}".strip()
    return {"title": title, "text": text, "rows": list(_effects(v, best)), "enough": enough}


def _effects(v: Verdict, change: Change) -> Iterator[Row]:
    """Yield what a change does, beside how it is."""
    if change.gain != v.gain:
        yield "gain D_p", quantity(v.gain, "N*s"), quantity(change.gain, "N*s")
    if change.held is not None:
        name, held = _missed_most(v)
        yield name, _DASH if held is None else _percent(held), _percent(change.held)
    if v.effect is not None and v.effect.is_harder and change.standing >= _KEPT:
        yield "contact harder than without mitigation", "yes", "no"
    own = None if v.stability is None else v.stability.margin
    if change.margin is not None and own is not None:
        yield "margin to instability", *(f"\u00d7 {number(margin, 3)}" for margin in (own, change.margin))
    if change.objective is not None and change.improvement is not None:
        before = _objective_before(change)
        yield "objective", number(before), f"{number(change.objective)} ({_objective_change(change)})"


def _objective_before(change: Change) -> float | None:
    """Return the objective as it is over the runs that the change was compared by, which are not all."""
    if change.objective is None or change.improvement is None or change.improvement >= 1:
        return None
    return change.objective / (1 - change.improvement)


def _missed_most(v: Verdict) -> tuple[str, float | None]:
    """Return what is missed most beside what is required, and in which share of the runs it comes true."""
    shares: list[tuple[str, float, float]] = []
    if v.reached is not None and v.reached.missing:
        share = 1 - v.reached.missing / round(v.reached.predicted * v.runs)
        shares.append(("contact comes in", share, share))
    shares += [(f"{c.statement} holds in", c.held, c.held / c.required.probability) for c in v.limits if not c.is_met]
    if not shares:  # it is missed in the runs that changes are compared by, and not in all
        return "what is missed most holds in", None
    name, held, _ = min(shares, key=lambda s: s[2])
    return name, held


def _percent(share: float) -> str:
    return f"{100 * share:.4g} %"


def _objective_change(change: Change) -> str:
    if change.improvement is None:
        return _DASH
    return _percent_with_error(-100 * change.improvement, 100 * (change.improvement_error or 0.0))


def _percent_with_error(value: float, error: float) -> str:
    digits = 1 if error >= 1 else 2
    if max(abs(value), error) < 0.5 * 0.1**digits:  # nothing that is shown: no sign either
        return "0 %"
    return f"{value:+.{digits}f}" + (f" \u00b1 {error:.{digits}f} %" if error else " %")


def change_rows(v: Verdict) -> Iterator[Row]:
    """Yield every change that was tried.

    Args:
        v: the verdict.

    Yields:
        What to do, whether it helps, the gain, the change of the objective, what is held, and the margin.
    """
    for change in v.changes:
        kept = "all" if change.standing >= _KEPT else "not all"
        yield (
            change.sentence,
            "yes" if change.helps else "no",
            quantity(change.gain, "N*s"),
            _objective_change(change),
            kept if change.held is None else f"{kept}: {_percent(change.held)}",
            _DASH if change.margin is None else f"\u00d7 {number(change.margin, 3)}",
        )


def change_note(v: Verdict) -> str:
    """Say how changes were compared.

    Args:
        v: the verdict.

    Returns:
        Sentences.
    """
    n = v.compared_runs
    text = f"Each was simulated on the same {n} run{'' if n == 1 else 's'}: the same encounters with the same noise"
    if n < v.runs:
        text += f", the first of the {v.runs}; another gain on all {v.runs}"
    return text + "."


def loss_text(v: Verdict) -> str:
    """Say what the verified gain costs beside the one that is best on this loop.

    Args:
        v: the verdict.

    Returns:
        A sentence; empty where it was not looked for.
    """
    loss = v.loss
    if loss is None:
        return ""
    if loss.loop_gain is None:
        return f"{best_gain_in_words(loss).capitalize()}, keeping every limit: none."
    best = f"the {best_gain_in_words(loss)}, {quantity(loss.loop_gain, 'N*s')}"
    if loss.loss is None or loss.loop_objective is None:
        return f"A run ends without contact, so that nothing is said of the cost beside {best}."
    share, error = 100 * loss.loss / loss.loop_objective, 100 * (loss.loss_error or 0.0) / loss.loop_objective
    text = f"of the objective ({_percent_with_error(share, error)})"
    if share <= _ERRORS * error or share <= 0:
        lacks = lacks_in_words(v) if share < -_ERRORS * error else ""
        return f"The verified gain costs no more than chance {text} beside {best}{lacks}."
    return f"The verified gain costs {number(share, 3)} % {text} beside {best}."


def loss_rows(v: Verdict) -> Iterator[Row]:
    """Yield the objective of the gains that matter.

    Args:
        v: the verdict.

    Yields:
        Name, gain, objective.
    """
    design, loss = v.design, v.loss
    if design.gain is not None:
        yield "ideal optimum, predicted", quantity(design.gain, "N*s"), number(design.objective, 5)
    if loss is None or v.gain is None:
        return
    own = quantity(v.gain, "N*s")
    if v.gain != design.gain:
        yield "verified gain, predicted", own, number(loss.predicted, 5)
    error = loss.standard_error
    spread = f" \u00b1 {error:.1g}" if error is not None and math.isfinite(error) and error > 0 else ""
    yield "verified gain, mean of the runs", own, number(loss.objective, 5) + spread
    if loss.loop_gain is not None:
        yield (
            f"{best_gain_in_words(loss)}, mean of the runs",
            quantity(loss.loop_gain, "N*s"),
            number(loss.loop_objective, 5),
        )
