"""Plot the stability limit of the gain and the simulated objective."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.numbers import BoolArray, FloatArray
from pretouch.verification import StabilityCheck, Verdict

from .panel_figure import panel_figure
from .panels import Curve, Mark, containing
from .style import Scale, gain_axis, objective_axis, scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_LOOP, _STRONGEST, _MARGIN, _IDEAL = 0, 1, 2, 4  # palette indices
_DECADES: Final = 1e3  # times the smallest stability limit: larger limits are not shown
_AROUND: Final = 1.4  # margin of a logarithmic axis, as a factor


@check_arguments
def verdict_stability(verdict: Verdict) -> Figure:
    """Draw the strongest stable gain at each distance.

    Args:
        verdict: a verdict with a stability check.

    Returns:
        One panel over the distance: the magnitude of the gain at which the loop becomes unstable, half of it (gain
        margin 2), and the verified gain.

    Raises:
        ResultUnavailableError: there is no stability check, no gain is unstable, or every gain is unstable.
    """
    check = verdict.stability
    if check is None or verdict.gain is None or not math.isfinite(check.strongest) or check.strongest == 0:
        raise ResultUnavailableError("stability: this verdict has no finite stability limit to draw")
    strongest = np.abs(check.limit.gain)
    visible = np.where(strongest <= _DECADES * abs(check.strongest), strongest, np.nan)
    scale = scale_for("m", float(check.limit.distance[np.isfinite(visible)].max()))
    distance = check.limit.distance / scale.factor
    gain = abs(verdict.gain)
    ends = [float(np.nanmin(visible)) / 2, float(np.nanmax(visible)), *([gain] if gain > 0 else [])]
    curves = [
        Curve(x=distance, y=visible, label="unstable above", style=_STRONGEST),
        Curve(x=distance, y=visible / 2, label="gain margin 2", style=_MARGIN),
    ]
    if gain > 0:
        curves.append(Curve(x=distance, y=np.full(len(distance), gain), label="verified gain", style=_LOOP))
    panel = containing(
        x_label=f"distance l [{scale.unit}]",
        y_label=gain_axis(verdict.design.bounds, verdict.law.number, magnitude=True)[1],
        curves=curves,
        marks=[_weakest_place(check, scale)],
        y_log=True,
        y_limits=(min(ends) / _AROUND, max(ends) * _AROUND),
    )
    return panel_figure(panel)


def _weakest_place(check: StabilityCheck, scale: Scale) -> Mark:
    text = check.limit.law.number.plot_text(abs(check.strongest))
    return Mark(x=check.critical_distance / scale.factor, y=abs(check.strongest), label=text, style=_STRONGEST)


@check_arguments
def verdict_gain(verdict: Verdict) -> Figure:
    """Draw the predicted and the simulated objective versus the gain.

    The prediction is in continuous time; the simulations use the sampled controller.

    Args:
        verdict: a verdict; without a gain, or without changes, only the objective in continuous time is drawn.

    Returns:
        One panel: the objective of the nominal encounter in continuous time, and its mean over the runs on the loop;
        thin and gray for gains that miss a limit. The ideal optimum, the verified gain, the best gain on the loop and
        the stability limit are marked.

    Raises:
        ResultUnavailableError: no gain within the bounds ends in contact.
    """
    sign, label, logarithmic = gain_axis(verdict.design.bounds, verdict.law.number)
    parts = [part for part in _objectives(verdict) if np.isfinite(part.objective).any()]
    if not parts:
        raise ResultUnavailableError("objective: no gain within the bounds ends in contact")
    marks = list(_gain_marks(verdict, sign))
    values = np.concatenate([part.objective for part in parts])
    shown = [m.y for m in marks] + [float(np.nanmin(_finite(part.objective))) for part in parts]
    top, wide, limits = objective_axis(values, shown)
    curves = [curve for part in parts for curve in part.curves(sign, top)]
    panel = containing(
        x_label=label,
        y_label="objective f [1]",
        curves=curves,
        marks=marks,
        positions=_stable_until(verdict, sign),
        x_log=logarithmic,
        y_log=wide,
        y_limits=limits,
    )
    return panel_figure(panel)


class _Part(NamedTuple):
    """Objective values for many gains, with a flag for feasible gains."""

    label: str
    style: int
    gain: FloatArray
    objective: FloatArray
    feasible: BoolArray

    def curves(self, sign: float, top: float) -> Iterator[Curve]:
        """Yield curves of the objective versus the gain.

        A curve is gray for gains that violate a limit, otherwise colored.
        """
        values = np.where(np.isfinite(self.objective) & (self.objective <= 1.02 * top), self.objective, np.nan)
        feasible = np.where(self.feasible, values, np.nan)
        any_feasible = np.isfinite(feasible).any()
        if np.isfinite(np.where(self.feasible, np.nan, values)).any():
            name = "" if any_feasible else f"{self.label}: limits missed"
            yield Curve(x=sign * self.gain, y=values, label=name, quiet=True)
        if any_feasible:
            yield Curve(x=sign * self.gain, y=feasible, label=self.label, style=self.style)


def _finite(values: FloatArray) -> FloatArray:
    return np.asarray(values[np.isfinite(values)])


def _objectives(verdict: Verdict) -> Iterator[_Part]:
    trade = verdict.design.trade_off
    yield _Part("ideal", _IDEAL, trade.gain, trade.objective, trade.feasible)
    if verdict.loss is not None and len(verdict.loss.curve.gain):
        curve = verdict.loss.curve
        yield _Part("on the loop", _LOOP, curve.gain, curve.objective, curve.standing >= 1 - 1e-12)


def _gain_marks(verdict: Verdict, sign: float) -> Iterator[Mark]:
    """Yield points that mark the optimal and the verified gain."""
    design, loss, number = verdict.design, verdict.loss, verdict.law.number
    if design.gain is not None and design.objective is not None:
        text = f"ideal {number.plot_text(design.gain)}"
        yield Mark(x=sign * design.gain, y=float(design.objective), label=text, style=_IDEAL, shape="ring")
    if loss is None or verdict.gain is None:
        return
    if loss.loop_gain is not None and loss.loop_objective is not None:
        text = f"best on the loop {number.plot_text(loss.loop_gain)}"
        yield Mark(x=sign * loss.loop_gain, y=loss.loop_objective, label=text, style=_LOOP, shape="ring")
    logarithmic = gain_axis(design.bounds, number)[2]
    if loss.objective is not None and (not logarithmic or sign * verdict.gain > 0):
        text = f"verified {number.plot_text(verdict.gain)}"
        yield Mark(x=sign * verdict.gain, y=loss.objective, label=text, style=_LOOP)


def _stable_until(verdict: Verdict, sign: float) -> dict[str, float]:
    """Return the gains with gain margins 1 (the stability limit) and 2 that are inside the plot."""
    check, loss = verdict.stability, verdict.loss
    low, high = verdict.design.bounds
    if check is None or loss is None:
        return {}
    places = {"stability limit": check.strongest, "gain margin 2": check.strongest / 2}
    return {text: sign * gain for text, gain in places.items() if low < gain < high and gain}
