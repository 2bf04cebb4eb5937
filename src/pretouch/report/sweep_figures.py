"""The pictures of a sweep; matplotlib at its top, but plots.pyi loads it only when a sweep is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.ticker import MaxNLocator

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.vocabulary import QUANTITIES, words_for

from .new_figure import new_figure
from .panel_figure import panel_figure
from .panels import Curve, Panel
from .style import BLOCKED, CURVES, INK, QUIET, Scale, drawing, log_axis, minus, scale_for

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_MOST_POINTS: Final = 1000  # along a curve
_MOST_CELLS: Final = 300  # along an axis of a map


def sweep(dataset: xr.Dataset, results: Sequence[str] | None = None) -> Figure:
    """Draw the results of a sweep over its axes.

    One axis gives curves. Two give a family of curves where one of them has up to five values, else a map of labeled
    contour lines, in which hatching marks encounters without a value. Axes of one value are left out.

    Args:
        dataset: what `sweep` returned, with one or two axes of more than one value.
        results: which of its results are drawn; all of them by default.

    Returns:
        A panel for each result.

    Raises:
        InvalidInputError: there are more axes, or no result with a value.
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
            f"dataset: found {len(dims)} axes of more than one value, expected one or two; choose values of the others "
            "first, for example with dataset.sel({'gain': -0.7}, method='nearest')"
        )
    for name in names:
        if not bool(np.isfinite(flat[name].values).any()):
            raise InvalidInputError(f"{name}: found no encounter with a value, expected some; status says why")
    if len(dims) == 1:
        return panel_figure(*(_panel(flat, name, dims[0], None) for name in names))
    across, up = sorted(dims, key=lambda dim: -flat.sizes[dim]) if _few(flat, dims) else dims
    if _few(flat, dims):
        return panel_figure(*(_panel(flat, name, across, up) for name in names))
    return _maps(flat, names, across, up)


def _few(flat: xr.Dataset, dims: list[str]) -> bool:
    return any(flat.sizes[dim] <= len(CURVES) for dim in dims)


def _axis(flat: xr.Dataset, dim: str) -> tuple[FloatArray, Scale, str]:
    """Return the values of an axis in the unit in which they are shown, that unit, and the label."""
    values = np.asarray(flat[dim].values, dtype=np.float64)
    scale = _scale(flat[dim], values)
    name = words_for(dim.replace(".", " ")) if "units" in flat[dim].attrs else f"{dim} number"
    return values / scale.factor, scale, f"{'gain D_p' if dim == 'gain' else name} [{scale.unit or '1'}]"


def _scale(variable: Any, values: FloatArray) -> Scale:
    unit = str(variable.attrs.get("units", "1"))
    known = values[np.isfinite(values)]
    return scale_for("" if unit == "1" else unit, float(np.max(np.abs(known), initial=0.0)))


def _label(name: str, scale: Scale, *, short: bool = False) -> str:
    q = QUANTITIES[name]
    words = f"optimal {q.words}" if name == "gain" else q.words
    return f"{words} {'' if short else q.symbol} [{scale.unit or '1'}]".replace("  ", " ")


def _equal_ratios(values: FloatArray) -> bool:
    """Tell whether an axis was made of equal ratios over a decade or more."""
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
    found = [(np.asarray(row.values)[::step] / scale.factor, label, style) for row, label, style in rows]
    curves = [_curve(x[::step], y, label, ordered, style) for y, label, style in found if np.isfinite(y).any()]
    return Panel(x_label=x_label, y_label=_label(name, scale), curves=curves, x_log=_equal_ratios(x))


def _curve(x: FloatArray, y: FloatArray, label: str, ordered: bool, style: int | None = None) -> Curve:
    if not ordered:  # samples, one beside another in no order
        return Curve(x=x, y=y, label=label, kind="points", style=style)
    order = np.argsort(x, kind="stable")
    return Curve(x=x[order], y=y[order], label=label, style=style)


def _maps(flat: xr.Dataset, names: list[str], across: str, up: str) -> Figure:

    thin = {dim: slice(None, None, -(-flat.sizes[dim] // _MOST_CELLS)) for dim in (across, up)}
    few = flat.isel(thin)
    x, _, x_label = _axis(few, across)
    y, _, y_label = _axis(few, up)
    maps = []
    for name in names:
        values = np.asarray(few[name].transpose(up, across).values, dtype=np.float64)
        scale = _scale(few[name], values)
        maps.append(
            Map(
                x=x,
                y=y,
                values=values / scale.factor,
                title=_label(name, scale, short=True),
                x_label=x_label,
                y_label=y_label,
                x_log=_equal_ratios(x),
                y_log=_equal_ratios(y),
            )
        )
    columns = min(2, len(maps))
    with drawing():
        figure = new_figure(7.4 if columns == 2 else 5.2, 3.3 * -(-len(maps) // columns))
        draw_maps(figure, maps, columns)
    return figure


_SHADES: Final = ("#7fb2d6", "#ffffff")  # from low to high: dark enough to be told apart, light enough for letters
_LEVELS: Final = 8
_CROWDED: Final = 0.6  # of the plane
_GAP: Final = 3.0  # pixels between the labels of lines


class Map(NamedTuple):
    """One quantity over two axes, in the units of the labels."""

    x: FloatArray
    y: FloatArray
    values: FloatArray
    title: str
    x_label: str
    y_label: str
    x_log: bool
    y_log: bool


def draw_maps(figure: Figure, maps: list[Map], columns: int) -> None:
    """Draw maps, row by row."""
    rows = -(-len(maps) // columns)
    inches = float(figure.get_size_inches()[1])
    figure.subplots_adjust(
        left=0.1 if columns == 2 else 0.14,
        right=0.97,
        bottom=0.5 / inches,
        top=1 - 0.42 / inches,
        wspace=0.3,
        hspace=0.9 * rows / max(inches - 0.82 * rows, 1.0),
    )
    for i, shown in enumerate(maps):
        _draw(figure, figure.add_subplot(rows, columns, i + 1), shown)


def _draw(figure: Figure, axes: Axes, shown: Map) -> None:
    axes.set_facecolor(BLOCKED)
    axes.set_xlabel(shown.x_label)
    axes.set_ylabel(shown.y_label)
    axes.set_title(shown.title, fontsize=8.0)
    known = shown.values[np.isfinite(shown.values)]
    for which, numbers, logarithmic in (("x", shown.x, shown.x_log), ("y", shown.y, shown.y_log)):
        low, high = float(numbers.min()), float(numbers.max())
        if logarithmic:
            log_axis(axes, which, low, high)
        else:
            (axes.set_xlim if which == "x" else axes.set_ylim)(low, high)
            (axes.xaxis if which == "x" else axes.yaxis).set_major_locator(MaxNLocator(6))
    low, high = float(known.min()), float(known.max())
    masked = np.ma.masked_invalid(shown.values)
    if not low < high:
        axes.contourf(shown.x, shown.y, masked, levels=[low - 1.0, low + 1.0], colors=[_SHADES[1]])
        axes.text(0.5, 0.5, minus(f"{low:.4g} everywhere"), transform=axes.transAxes, ha="center", color=INK)
        return
    levels = _levels(known)
    shades: Any = LinearSegmentedColormap.from_list("pretouch", _SHADES)
    axes.contourf(shown.x, shown.y, masked, levels=levels, cmap=shades)
    inner = [level for level in levels if low < level < high]
    lines = axes.contour(shown.x, shown.y, masked, levels=inner, colors=INK, linewidths=0.8, linestyles="solid")
    labels = axes.clabel(lines, fmt=_level, fontsize=7.5, inline=False)
    for label in labels:
        label.set_bbox({"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6})
    _thin_out(figure, axes, list(labels))
    if masked.mask.any():
        _hatch(axes, shown)


def _levels(known: FloatArray) -> FloatArray:
    """Choose levels: equally spaced, or of equally large areas where nearly everything lies between two of those."""
    low, high = float(known.min()), float(known.max())
    even = np.asarray(MaxNLocator(_LEVELS).tick_values(low, high))
    if np.histogram(known, even)[0].max() < _CROWDED * known.size:
        return even
    digits = 1 - int(np.floor(np.log10(max(abs(low), abs(high)))))
    for finer in range(digits, digits + 6):
        inner = np.unique(np.round(np.quantile(known, np.linspace(0, 1, _LEVELS)[1:-1]), finer))
        if len(inner) >= _LEVELS // 2:
            break
    return np.unique(np.concatenate([even[:1], inner[(inner > even[0]) & (inner < even[-1])], even[-1:]]))


def _hatch(axes: Axes, shown: Map) -> None:
    """Mark where there is no value, and say so."""
    missing = np.isnan(shown.values).astype(float)
    filled = axes.contourf(shown.x, shown.y, missing, levels=[0.5, 1.5], colors="none", hatches=["////"])
    filled.set_edgecolor(QUIET)
    filled.set_linewidth(0.0)
    axes.set_title(f"{shown.title}\nhatched: no value", fontsize=8.0)


def _thin_out(figure: Figure, axes: Axes, labels: list[Any]) -> None:
    """Take away labels that cover others or leave the axes."""
    canvas: Any = FigureCanvasAgg(figure)
    renderer = canvas.get_renderer()
    frame = axes.get_window_extent(renderer)
    kept: list[Any] = []
    for label in labels:
        box = label.get_window_extent(renderer)
        outside = box.x0 < frame.x0 or box.x1 > frame.x1 or box.y0 < frame.y0 or box.y1 > frame.y1
        if outside or any(box.padded(_GAP).overlaps(other) for other in kept):
            label.remove()
        else:
            kept.append(box)


def _level(value: float) -> str:
    return minus(f"{value:.4g}")
