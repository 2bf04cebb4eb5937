"""Plot Pareto fronts, and the best objective versus admittance parameters."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import pretty_unit
from pretouch._core.vocabulary import words_for
from pretouch.designs.admittance_result import AdmittanceDesign
from pretouch.designs.front.dominance import shortfall
from pretouch.designs.front.result import FrontPoint, ParetoFront

from .panel_figure import panel_figure
from .panels import Curve, Mark, Panel
from .style import WIDE, Scale, scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_WORSE: Final = 2e-3  # of the extent of the front: a point that is worse by this in all quantities is dominated
_MOST_DOMINATED: Final = 400  # dominated points that are drawn
_PARAMETERS: Final = {
    "natural_frequency": ("natural frequency", "rad/s"),
    "damping_ratio": ("damping ratio", ""),
}


@check_arguments
def pareto(front: ParetoFront) -> Figure:
    """Draw a Pareto front, its design parameters and the physical bound.

    The bound holds for any controller.

    Args:
        front: a front with points.

    Returns:
        A panel for each pair of quantities, with knee and choice; the gain and the free parameters of the admittance
        along the front; and the excursion over the contact speed, compared with the least excursion of any robot with
        the same largest acceleration.

    Raises:
        InvalidInputError: the front is empty.
    """
    if not len(front.gain):
        raise InvalidInputError(
            f"front: this Pareto front has no points (status: {front.status.value}), so there is nothing to draw"
        )
    pairs = list(combinations(range(len(front.quantities)), 2))
    panels = [_plane(front, *pair) for pair in pairs]
    if front.comparison is not None and np.isfinite(front.comparison.least_excursion).any():
        panels.append(_bound(front))
    panels += _parameters(front)
    return panel_figure(*panels, columns=2)


@check_arguments
def admittance(design: AdmittanceDesign) -> Figure:
    """Draw the best objective versus the parameters of the admittance.

    The parameters are the natural frequency and the damping ratio. Each admittance has its best gain.

    Args:
        design: a design of gain and admittance, with at least one feasible admittance.

    Returns:
        One panel: over the natural frequency for several damping ratios, or over the only free parameter.

    Raises:
        InvalidInputError: no admittance of the grid is feasible.
    """
    m = design.map
    if not np.isfinite(m.objective).any():
        raise InvalidInputError("design: found no feasible admittance, expected at least one")
    value = np.where(np.isfinite(m.objective), m.objective, np.nan)
    only_ratio = design.natural_frequency_bounds is None
    across = m.damping_ratio if only_ratio else m.natural_frequency
    if value.ndim == 1:
        curves = [Curve(x=across, y=value, label="best gain", kind="both")]
    else:
        shown = np.unique(np.linspace(0, value.shape[1] - 1, 5).round().astype(int))
        curves = [
            Curve(x=across[:, j], y=value[:, j], label=f"damping ratio {m.damping_ratio[0, j]:.3g}")
            for j in shown
            if np.isfinite(value[:, j]).any()
        ]
    marks = []
    best, unchanged = design.certificate, design.unchanged
    if best is not None:
        minimum = best.local_minima[0]
        x = minimum.damping_ratio if only_ratio else minimum.natural_frequency
        marks.append(Mark(x=x, y=minimum.objective, label="chosen"))
    original = unchanged.scenario.admittance
    low, high = float(across.min()), float(across.max())
    x = float(original.natural_frequency)
    if only_ratio:
        x = float(original.damping_ratio) if original.stiffness > 0 else float("nan")
    if unchanged.objective is not None and low <= x <= high:
        marks.append(Mark(x=x, y=float(unchanged.objective), label="without change", shape="square"))
    name, unit = _PARAMETERS["damping_ratio" if only_ratio else "natural_frequency"]
    panel = Panel(
        x_label=f"{name} [{unit or '1'}]",
        y_label="objective f of the best gain [1]",
        curves=curves,
        marks=marks,
        x_log=_is_wide(across),
        y_log=_is_wide(value),
    )
    return panel_figure(panel)


def _plane(front: ParetoFront, i: int, k: int) -> Panel:
    """Return a plot of a Pareto front for two quantities."""
    names = front.quantities[i], front.quantities[k]
    across, up = (_scale(front, name, _all_values(front, name)) for name in names)
    x, y = front.of(names[0]) / across.factor, front.of(names[1]) / up.factor
    curves = []
    dominated = _dominated(front, i, k) / [across.factor, up.factor]
    if len(dominated):
        curves.append(Curve(x=dominated[:, 0], y=dominated[:, 1], label="dominated", kind="points", quiet=True))
    if _is_curve(front):
        curves.append(Curve(x=_broken(front, x), y=_broken(front, y), label="Pareto front", style=0))
    else:
        curves.append(Curve(x=x, y=y, label="Pareto front", kind="points", style=0))
    first, second = (front.number.entry(name) for name in names)
    title = "Trade-off" if len(front.quantities) == 2 else f"{second.short.capitalize()} over {first.short}"
    return Panel(
        x_label=f"{first.words} [{across.unit}]",
        y_label=f"{second.words} [{up.unit}]",
        title=title,
        curves=curves,
        marks=[
            _mark(point, point.values[names[0]] / across.factor, point.values[names[1]] / up.factor)
            for point in front.marked
        ],
        x_log=_is_wide(x) and len(front.quantities) == 3,
        y_log=_is_wide(y) and len(front.quantities) == 3,
    )


def _bound(front: ParetoFront) -> Panel:
    """Return a plot of the smallest excursion that any controller needs."""
    c = front.comparison
    if c is None or front.result is None:
        raise InvalidInputError("front: this Pareto front has no physical bound to draw")
    speed = np.abs(front.result.end.relative_velocity)
    up, across = scale_for("m", float(np.max(c.excursion))), scale_for("m/s", float(speed.max()))
    order = np.argsort(speed, kind="stable")
    x = speed[order] / across.factor
    kind: Any = "line" if _is_curve(front) else "points"
    excursion, least = (_positive(values[order] / up.factor) for values in (c.excursion, c.least_excursion))
    curves = [
        Curve(x=x, y=excursion, label="this controller", style=0, kind=kind),
        Curve(x=x, y=least, label="any robot, same acceleration", style=1, kind=kind),
    ]
    if front.bound is not None:
        w = np.linspace(float(front.bound.least_contact_speed), float(speed.max()), 60)
        least = _positive(np.asarray(front.bound.excursion(w)) / up.factor)
        limit = f"any robot, {front.bound.acceleration_limit:g} m/s\u00b2"
        curves.append(Curve(x=w / across.factor, y=least, label=limit, style=2))
    marks = [
        _mark(p, abs(float(p.result.end.relative_velocity)) / across.factor, float(p.bound.excursion) / up.factor)
        for p in front.marked
        if p.bound is not None and p.bound.excursion > 0
    ]
    return Panel(
        x_label=f"{words_for('relative_velocity')} [{across.unit}]",
        y_label=f"excursion at contact [{up.unit}]",
        title="Physical bound of any controller",
        curves=curves,
        marks=marks,
        y_log=True,
    )


def _parameters(front: ParetoFront) -> Iterator[Panel]:
    """Yield one plot for each free parameter along the Pareto front."""
    name = front.quantities[0]
    scale = _scale(front, name, front.of(name))
    x = front.of(name) / scale.factor
    order = np.argsort(x, kind="stable")
    sign, minus = (-1.0, "\u2212") if front.bounds[1] <= 0 else (1.0, "")
    n = front.number
    rows = [("gain", f"{n.name} {minus}{n.plot_symbol}", pretty_unit(n.unit), sign)]
    rows += [(free, *_PARAMETERS[free], 1.0) for free in front.free[1:]]
    for parameter, label, unit, factor in rows:
        values = factor * getattr(front, parameter)
        points = [(p, factor * getattr(p, parameter)) for p in front.marked if p.feasible]
        if _is_curve(front):
            curve = Curve(x=_broken(front, x), y=_broken(front, values), style=0)
        else:
            curve = Curve(x=x[order], y=values[order], kind="points", style=0)
        yield Panel(
            x_label=f"{n.entry(name).words} [{scale.unit}]",
            y_label=f"{label} [{unit or '1'}]",
            title=f"{(n.name if parameter == 'gain' else label).capitalize()} along the front",
            curves=[curve],
            marks=[_mark(p, p.values[name] / scale.factor, at) for p, at in points if np.isfinite(at)],
            y_log=_is_wide(values),
            x_log=_is_wide(x) and len(front.quantities) == 3,
        )


def _mark(point: FrontPoint, x: float, y: float) -> Mark:
    return Mark(x=x, y=y, label=point.name, shape="dot" if point.name == "knee" else "square")


def _all_values(front: ParetoFront, name: str) -> FloatArray:
    parts = [front.of(name), np.array([p.values[name] for p in front.marked])]
    return np.concatenate(parts)


def _scale(front: ParetoFront, name: str, values: FloatArray) -> Scale:
    return scale_for(front.number.entry(name).unit, float(np.abs(values).max()))


def _is_curve(front: ParetoFront) -> bool:
    """Return True if a Pareto front is a curve."""
    return len(front.quantities) == 2 or front.free == ("gain",)


def _dominated(front: ParetoFront, i: int, k: int) -> FloatArray:
    """Return some dominated points within the limits of the plot."""
    extent = np.ptp(front.values, axis=0)
    extent = np.where(extent > 0, extent, 1.0)
    limits = [float(_all_values(front, front.quantities[j]).max()) for j in (i, k)]
    points = front.scanned[(front.scanned[:, [i, k]] <= limits).all(axis=1)]
    points = points[shortfall(points / extent, front.values / extent) < -_WORSE]
    return np.asarray(points[:: max(1, len(points) // _MOST_DOMINATED)][:, [i, k]])


def _broken(front: ParetoFront, values: FloatArray) -> FloatArray:
    """Insert NaN between the separate pieces of a Pareto front."""
    return np.insert(values, np.flatnonzero(np.diff(front.piece)) + 1, np.nan)


def _positive(values: Any) -> FloatArray:
    numbers = np.asarray(values, dtype=np.float64)
    return np.where(numbers > 0, numbers, np.nan)


def _is_wide(values: FloatArray) -> bool:
    numbers = values[np.isfinite(values)]
    return bool(len(numbers) and numbers.min() > 0 and numbers.max() > WIDE * numbers.min())
