"""Plot the results of a sweep as curves or maps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.vocabulary import QUANTITIES, words_for

from .panel_figure import panel_figure
from .panels import Curve, Map, Panel
from .style import CURVES, Scale, scale_for

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


_MOST_POINTS: Final = 1000  # along a curve
_MOST_CELLS: Final = 300  # along an axis of a map


@check_arguments
def sweep(dataset: xr.Dataset, results: Sequence[str] | None = None) -> Figure:
    """Draw the results of a parameter sweep as curves or maps.

    With one axis, results are curves. With two axes, they are a family of curves if an axis has up to five values,
    otherwise maps with contour lines, in which encounters without a value are hatched. Axes of one value are ignored.

    Args:
        dataset: the result of `sweep`, with one or two axes of more than one value.
        results: names of the results to draw; None for all.

    Returns:
        A panel for each result.

    Raises:
        InvalidInputError: there are more than two axes, or a result without values.
    """
    flat = dataset.squeeze(drop=True)
    names = [str(n) for n in (results or flat.data_vars) if n != "status"]
    unknown = next((n for n in names if n not in flat.data_vars), None)
    if unknown is not None or not names:
        listed = ", ".join(str(n) for n in flat.data_vars if n != "status")
        raise InvalidInputError(f"results: found {unknown or 'none'}, expected some of {listed}")
    dims = [str(dim) for dim in flat["status"].dims]
    if len(dims) not in {1, 2}:
        raise InvalidInputError(
            f"dataset: found {len(dims)} axes with several values, but a figure can show only one or two axes. "
            "Select one value of each other axis first, for example with "
            f"dataset.sel({{'gain': -0.7}}, method='nearest')"
        )
    for name in names:
        if not bool(np.isfinite(flat[name].values).any()):
            raise InvalidInputError(
                f"{name}: found no finite value of this result in the sweep, so there is nothing to draw. "
                "The variable `status` of the dataset gives the reasons"
            )
    if len(dims) == 1:
        return panel_figure(*(_panel(flat, name, dims[0], None) for name in names))
    is_family = any(flat.sizes[dim] <= len(CURVES) for dim in dims)
    across, up = sorted(dims, key=lambda dim: -flat.sizes[dim]) if is_family else dims
    return panel_figure(*((_panel if is_family else _map)(flat, name, across, up) for name in names))


def _axis(flat: xr.Dataset | xr.DataArray, dim: str) -> tuple[FloatArray, Scale, str]:
    """Return the values of a sweep axis in a display unit."""
    values = np.asarray(flat[dim].values, dtype=np.float64)
    scale = _scale(flat[dim], values)
    name = words_for(dim.replace(".", " ")) if "units" in flat[dim].attrs else f"{dim} number"
    if dim == "gain":  # the gain of the letter's law, or the number of another law, whose name is in long_name
        name = str(flat[dim].attrs.get("long_name", name))
        name = "gain D_p" if name == "gain" else name
    return values / scale.factor, scale, f"{name} [{scale.unit or '1'}]"


def _scale(variable: Any, values: FloatArray) -> Scale:
    unit = str(variable.attrs.get("units", "1"))
    finite = values[np.isfinite(values)]
    return scale_for("" if unit == "1" else unit, float(np.max(np.abs(finite), initial=0.0)))


def _label(variable: Any, scale: Scale, *, short: bool = False) -> str:
    name, long_name = str(variable.name), str(variable.attrs.get("long_name", "gain"))
    if name not in QUANTITIES:  # a result of another simulation, such as of a whole robot
        return f"{long_name} [{scale.unit or '1'}]"
    q = QUANTITIES[name]
    if name == "gain" and long_name not in {"gain", "optimal gain"}:  # the number of another law
        return f"{long_name} [{scale.unit or '1'}]"
    words = f"optimal {q.words}" if name == "gain" else q.words
    return f"{words} {'' if short else q.symbol} [{scale.unit or '1'}]".replace("  ", " ")


def _is_logarithmic(values: FloatArray) -> bool:
    """Return True if the values of a sweep axis are logarithmically spaced. They must span at least one decade."""
    if len(values) < 3 or not (values > 0).all() or values.max() < 10 * values.min():
        return False
    return bool(np.allclose(np.diff(np.log(values)), np.log(values[-1] / values[0]) / (len(values) - 1), rtol=1e-6))


def _panel(flat: xr.Dataset, name: str, across: str, family: str | None) -> Panel:
    x, _, x_label = _axis(flat, across)
    step = -(-len(x) // _MOST_POINTS)
    variable, ordered = flat[name], "units" in flat[across].attrs
    scale = _scale(variable, np.asarray(variable.values))
    rows: list[tuple[Any, str, int | None]] = [(variable, "", None)]
    if family is not None:
        values, unit, _ = _axis(flat, family)
        names = [f"{words_for(family.rpartition('.')[2])} {value:.4g} {unit.unit}".strip() for value in values]
        rows = [(variable.isel({family: i}), label, i) for i, label in enumerate(names)]
    columns = [(np.asarray(row.values)[::step] / scale.factor, label, style) for row, label, style in rows]
    curves = [_curve(x[::step], y, label, ordered, style) for y, label, style in columns if np.isfinite(y).any()]
    return Panel(x_label=x_label, y_label=_label(flat[name], scale), curves=curves, x_log=_is_logarithmic(x))


def _curve(x: FloatArray, y: FloatArray, label: str, ordered: bool, style: int | None = None) -> Curve:
    if not ordered:  # samples without an order
        return Curve(x=x, y=y, label=label, kind="points", style=style)
    order = np.argsort(x, kind="stable")
    return Curve(x=x[order], y=y[order], label=label, style=style)


def _map(flat: xr.Dataset, name: str, across: str, up: str) -> Panel:
    steps = {dim: slice(None, None, -(-flat.sizes[dim] // _MOST_CELLS)) for dim in (across, up)}
    thinned = flat[name].transpose(up, across).isel(steps)
    (x, _, x_label), (y, _, y_label) = _axis(thinned, across), _axis(thinned, up)
    values = np.asarray(thinned.values, dtype=np.float64)
    scale = _scale(thinned, values)
    holes = "" if np.isfinite(values).all() else ", hatched: no value"
    return Panel(
        x_label=x_label,
        y_label=y_label,
        title=_label(flat[name], scale, short=True) + holes,
        map=Map(x=x, y=y, values=values / scale.factor),
        x_log=_is_logarithmic(x),
        y_log=_is_logarithmic(y),
    )
