"""Plot a robust gain design and the distributions of its results."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.numbers import FloatArray
from pretouch.designs.robust.outcomes import RobustOutcomes
from pretouch.designs.robust.price import Price
from pretouch.designs.robust.result import RobustDesign

from .panel_figure import panel_figure
from .panels import Curve, Mark, Panel, containing
from .share_panels import outcome_panel, share_panel
from .style import Scale, gain_axis, objective_axis, scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_MOST_PRICES: Final = 4
_ROBUST, _NOMINAL, _NONE = 0, 1, 2  # palette indices: a gain has the same style in all figures


@check_arguments
def robust(design: RobustDesign) -> Figure:
    """Draw the risk measure and the objective distribution of a robust gain.

    Args:
        design: a design of any status.

    Returns:
        Two panels: the measure of the objective over the gain on the samples of the design, compared with the objective
        of the nominal encounter, with the robust and the nominal gain; and the share of fresh encounters in which the
        objective is below a value, for both gains.
    """
    if not any(run.reached.any() for _, _, run in _runs(design)):
        return panel_figure(_measure_panel(design))
    return panel_figure(_measure_panel(design), _objective_panel(design))


@check_arguments
def outcome(design: RobustDesign) -> Figure:
    """Draw the distributions of contact quantities in new random encounters.

    Args:
        design: a design of any status.

    Returns:
        At most four panels: first the quantities with a constraint, then the relative speed at contact, the largest
        excursion and the time of contact. A panel shows the share of encounters in which the quantity is below a value:
        with the robust gain (or the nearest gain, if none is feasible), with the nominal gain and without mitigation.
        The limit is shown as well.

    Raises:
        ResultUnavailableError: no encounter ends in contact.
    """
    runs = _runs(design)
    if not any(run.reached.any() for _, _, run in runs):
        raise ResultUnavailableError("outcomes: no encounter ends in contact, so there is nothing to draw")
    return panel_figure(*(_outcome_panel(design, name, runs) for name in _quantities(design)))


@check_arguments
def price(design: RobustDesign) -> Figure:
    """Draw the objective loss of a robust gain versus uncertain inputs.

    Args:
        design: a design with a gain.

    Returns:
        Two panels for each input: the best gain for each of its values compared with the robust gain, and the loss of
        the robust and of the nominal gain in percent of the best objective.

    Raises:
        ResultUnavailableError: the design has no value of information.
    """
    prices = design.prices[:_MOST_PRICES]
    if not prices:
        raise ResultUnavailableError("price: this design has no value of information to draw; see its status")
    return panel_figure(*(panel for price in prices for panel in _price_panels(design, price)), height=2.6)


def _runs(design: RobustDesign) -> list[tuple[str, int, RobustOutcomes]]:
    """Return name, color and results of each compared gain."""
    styles = {design.nominal_name: _NOMINAL, "no mitigation": _NONE}
    return [(name, styles.get(name, _ROBUST), run) for name, run in design.compared.items()]


def _measure_panel(design: RobustDesign) -> Panel:
    """Return a plot of the risk measure versus the gain. Values far above the minimum are not drawn."""
    sign, label, logarithmic = gain_axis(design.bounds, design.number)
    curve = design.trade_off
    nominal = _nominal_objective(design, curve.gain)
    values = np.concatenate([curve.value, nominal])
    marks = list(_gain_marks(design, sign, curve.gain, nominal))
    top, wide, limits = objective_axis(values, [mark.y for mark in marks])
    parts = [
        ("", curve.value, True, _ROBUST),
        (f"{design.measure.label}, sampled", np.where(curve.feasible, curve.value, np.nan), False, _ROBUST),
        (f"objective of the {_kind(design)} encounter", nominal, False, _NOMINAL),
    ]
    curves = []
    for name, values, quiet, style in parts:
        visible = np.where(np.isfinite(values) & (values <= 1.02 * top), values, np.nan)
        if np.isfinite(visible).any():
            curves.append(
                Curve(x=sign * curve.gain, y=visible, label=name, quiet=quiet, style=None if quiet else style)
            )
    if not curves:
        curves = [Curve(x=sign * np.array(design.bounds), y=[0.0, 0.0], quiet=True)]
    return containing(
        x_label=label,
        y_label="measure of the objective [1]",
        title="Measure over the gain",
        curves=curves,
        marks=marks,
        x_log=logarithmic,
        y_log=wide,
        y_limits=limits,
    )


def _nominal_objective(design: RobustDesign, gains: FloatArray) -> FloatArray:
    """Return the objective of the nominal encounter for many gains. The objective is infinite without contact."""
    ensemble = design.problem.ensemble
    options: dict[str, Any] = {"method": ensemble.method, "horizon": ensemble.horizon}
    contact = ensemble.law.contact(design.scenario, design.sensor, gains, **options)
    speed = abs(design.scenario.obstacle.velocity)
    return np.where(contact.reached, design.definition.value(contact.end, speed, design.impact), np.inf)


def _gain_marks(design: RobustDesign, sign: float, gains: FloatArray, nominal: FloatArray) -> Iterator[Mark]:
    if design.gain is not None and design.value is not None:
        text = f"robust {design.number.plot_text(design.gain)}"
        yield Mark(x=sign * design.gain, y=design.value, label=text, style=_ROBUST)
    if design.nominal_gain is not None:
        objective = float(np.interp(design.nominal_gain, gains, nominal))
        if np.isfinite(objective):
            text = f"{_kind(design)} {design.number.plot_text(design.nominal_gain)}"
            yield Mark(x=sign * design.nominal_gain, y=objective, label=text, style=_NOMINAL, shape="square")


def _kind(design: RobustDesign) -> str:
    """Return the plot label of the nominal encounter. The label is `ideal` with a sampled loop, otherwise `nominal`."""
    return "ideal" if design.on_evaluator else "nominal"


def _objective_panel(design: RobustDesign) -> Panel:
    runs = [(name, style, run.objective) for name, style, run in _runs(design)]
    shown = [r for r in runs if r[1] != _NONE] or runs  # the objective without mitigation would dominate the scale
    return share_panel(shown, "objective f", Scale(1.0, ""), of="encounters", title="Objective over fresh encounters")


def _quantities(design: RobustDesign) -> list[str]:
    names = [limit.constraint.quantity for limit in design.limits]
    names += ["relative_velocity", "largest_excursion", "time"]
    return list(dict.fromkeys(names))[:4]


def _outcome_panel(design: RobustDesign, name: str, runs: list[tuple[str, int, RobustOutcomes]]) -> Panel:
    """Return a plot of the distribution of one quantity."""
    columns = [(label, style, run.magnitude(name)) for label, style, run in runs]
    required = next((r for r in design.limits if r.constraint.quantity == name), None)
    limit = None if required is None else (required.constraint.limit, required.probability)
    return outcome_panel(name, columns, limit, of="encounters")


def _price_panels(design: RobustDesign, price: Price) -> Iterator[Panel]:
    """Yield plots of best gain and objective loss versus one input."""
    scale = scale_for(price.unit, float(np.abs(price.value).max()))
    x = price.value / scale.factor
    across = f"{price.name} [{scale.unit or '1'}]"
    sign, label, _ = gain_axis(design.bounds, design.number)
    robust = 0.0 if design.gain is None else sign * design.gain
    yield Panel(
        x_label=across,
        y_label=label,
        curves=[
            Curve(x=x, y=sign * price.best_gain, label="best gain for each value", style=4),
            Curve(x=x, y=np.full(len(x), robust), label="robust gain", style=_ROBUST),
        ],
    )
    yield Panel(
        x_label=across,
        y_label="loss relative to the best gain [%]",
        curves=list(_loss_curves(design, price, x)),
    )


def _loss_curves(design: RobustDesign, price: Price, x: FloatArray) -> Iterator[Curve]:
    yield Curve(x=x, y=100 * price.loss, label="robust gain", style=_ROBUST)
    if design.nominal_gain is not None:
        nominal = design.price_of(design.nominal_gain, price)
        if np.isfinite(nominal.loss).any():
            yield Curve(x=x, y=100 * nominal.loss, label="nominal gain", style=_NOMINAL)
