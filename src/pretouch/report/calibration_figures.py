"""Figures of a calibration: readings, fitted curves, slopes and residuals."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.numbers import BoolArray, FloatArray

from .labels import label_inside, label_near
from .new_figure import new_figure
from .style import BASELINE, CURVES, INK, LIMIT, QUIET, Scale, drawing, log_axis, scale_for, span

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pretouch.calibration.result import CalibrationReport, SensorFit


_WINDOW: Final = "#eef4f9"
_FINE: Final = 120
_TWO_SIGMA: Final = 2.0


class _Points(NamedTuple):
    """Averaged readings of a calibration fit: distances, log outputs and their standard deviations."""

    distance: FloatArray
    log_output: FloatArray
    deviation: FloatArray


@check_arguments
def calibration(report: CalibrationReport) -> Figure:
    """Draw a calibration with its fitted models.

    Args:
        report: a report with any verdict.

    Returns:
        Four panels over the distance: the readings with offset, clipping level, floor and usable window; the signal
        above the offset on a logarithmic axis; its slope g compared with difference quotients of the readings; and the
        residuals of ln xi. Without a usable signal, only the panel of readings.
    """
    with drawing():
        if not report.fits:
            figure = new_figure(7.4, 3.2)
            axes = figure.add_subplot()
            figure.subplots_adjust(left=0.11, right=0.972, bottom=0.15, top=0.9)
            _draw_readings(axes, report)
            return figure
        figure = new_figure(7.4, 5.8)
        panels = [figure.add_subplot(2, 2, i + 1) for i in range(4)]
        figure.subplots_adjust(left=0.11, right=0.972, bottom=0.085, top=0.95, wspace=0.29, hspace=0.34)
        for axes, draw in zip(panels, (_draw_readings, _draw_log_output, _draw_slope, _draw_residuals), strict=True):
            draw(axes, report)
    return figure


def _draw_readings(axes: Axes, report: CalibrationReport) -> None:
    """Draw all calibration readings with offset, floor, clipping level, usable range and fitted curves."""
    scale = _begin(axes, report, "Readings and their use" if report.fits else "Readings: no usable signal")
    outputs = report.calibration.outputs
    axes.set_ylabel(f"output [{_unit(report)}]", parse_math=False)
    levels = [level for level, *_ in _levels(report)]
    low, high = span(np.array([*outputs, *report.calibration.no_object, *levels]), 0.08)
    axes.set_ylim(low, high)
    groups = list(_groups(report))
    for _, mask, marker, color, fill in groups:
        x, y = report.calibration.distances[mask] / scale.factor, outputs[mask]
        axes.plot(x, y, marker, color=color, markerfacecolor=fill, markersize=4.2, linestyle="None", zorder=4)
    _draw_curves(axes, report, scale, lambda fit, distance: fit.offset.value + fit.sensor.output(distance))
    _draw_levels(axes, report)
    for text, mask, _, color, _ in groups:
        if not text:
            continue
        x, y = report.calibration.distances[mask] / scale.factor, outputs[mask]
        label_near(axes, x, y, text, color=color, size=7.5)
    if report.window.distances:
        x, y = np.meshgrid(np.array([0.5, 0.4, 0.6, 0.3, 0.7, 0.0, 1.0]), np.linspace(0.94, 0.2, 12))
        left, right = report.window.l_min / scale.factor, report.window.l_max / scale.factor
        label_inside(
            axes,
            left + (right - left) * x.ravel(),
            low + (high - low) * y.ravel(),
            "usable window",
            color=QUIET,
            size=7.5,
            fill=_WINDOW,
        )


def _draw_levels(axes: Axes, report: CalibrationReport) -> None:
    """Draw offset, floor and clipping level of a calibration; labels that are close together are merged."""
    levels = list(_levels(report))
    left, right = axes.get_xlim()
    across = left + (right - left) * np.array([0.98, 0.8, 0.6, 0.4, 0.2])
    low, high = axes.get_ylim()
    close = len(levels) > 1 and levels[1][0] - levels[0][0] < 0.09 * (high - low) and report.offset is not None
    for level, _, style, spread, _ in levels:
        axes.axhline(level, color=LIMIT, linestyle=style, linewidth=1.0, zorder=2)
        if spread:
            axes.axhspan(*spread, color="#cfcfcf", linewidth=0, zorder=1)
    if close:
        text = f"{levels[0][1]}; floor of the signal (dashed)"
        levels[:2] = [(*levels[0][:1], text, *levels[0][2:])]
    for level, text, _, _, side in levels:
        label_near(axes, across, np.full(5, level), text, color=LIMIT, size=7.5, side=side, reach=34.0)


def _draw_log_output(axes: Axes, report: CalibrationReport) -> None:
    """Draw the sensor output minus its offset versus the distance, on a logarithmic axis."""
    scale = _begin(axes, report, "Signal, logarithmic", zoom=True)
    points = _points(report)
    axes.set_ylabel(f"output \u2212 offset [{_unit(report)}], log. axis", parse_math=False)
    value = np.exp(points.log_output)
    low, high = float(value.min()), float(value.max())
    log_axis(axes, "y", low / (high / low) ** 0.12, high * (high / low) ** 0.12)
    spread = value * np.abs(np.expm1(_TWO_SIGMA * np.vstack([-points.deviation, points.deviation])))
    _draw_points(axes, points.distance / scale.factor, value, spread)
    _draw_curves(axes, report, scale, lambda fit, distance: fit.sensor.output(distance), named=True)
    label_near(
        axes,
        points.distance[::-1] / scale.factor,
        (value + spread[1])[::-1],
        "\u00b12 standard deviations",
        color=QUIET,
        size=7.5,
    )


def _draw_slope(axes: Axes, report: CalibrationReport) -> None:
    """Draw the sensor slope g of the fitted curves, and difference quotients of neighboring readings."""
    scale = _begin(axes, report, "Slope g: the damping force is D\u209a g l\u2032", zoom=True)
    points = _points(report)
    axes.set_ylabel("slope g = d ln \u03be / dl [1/m]")
    middle = (points.distance[1:] + points.distance[:-1]) / 2
    step = np.diff(points.distance)
    slope = np.diff(points.log_output) / step
    spread = _TWO_SIGMA * np.hypot(points.deviation[1:], points.deviation[:-1]) / step
    drawn = np.concatenate(
        [fit.sensor.log_slope(d) for fit, d, *_ in _curves(report) if fit.model != "table"] or [slope]
    )
    low, high = span(np.concatenate([drawn, slope, [0.0]]))
    reach = 1.2 * (float(drawn.max()) - float(drawn.min())) + 0.35 * float(np.abs(drawn).max())
    axes.set_ylim(max(low, float(drawn.min()) - reach), min(high, float(drawn.max()) + reach))
    axes.axhline(0, color=QUIET, linewidth=0.7, zorder=1.5)
    _draw_points(axes, middle / scale.factor, slope, np.vstack([spread, spread]))
    _draw_curves(axes, report, scale, lambda fit, distance: fit.sensor.log_slope(distance), named=True)


def _draw_residuals(axes: Axes, report: CalibrationReport) -> None:
    """Draw the residuals of the log output for each fitted curve, with the range of the noise."""
    scale = _begin(axes, report, "Residuals of the models", zoom=True)
    points = _points(report)
    axes.set_ylabel("residual of ln \u03be [1]")
    bounds = _TWO_SIGMA * points.deviation
    parts = [fit.residuals for fit in report.fits if fit.model != "table"] or [report.fits[0].residuals]
    largest = float(np.max(np.abs(np.concatenate([*parts, np.minimum(bounds, 0.5)])))) or 1.0
    axes.set_ylim(-1.3 * largest, 1.3 * largest)
    axes.axhline(0, color=QUIET, linewidth=0.8, zorder=1.5)
    axes.fill_between(points.distance / scale.factor, -bounds, bounds, color="#d9d9d9", linewidth=0, zorder=1)
    for i, fit in enumerate(report.fits):
        color, style = CURVES[i % len(CURVES)]
        axes.plot(
            fit.distances / scale.factor,
            fit.residuals,
            color=color,
            linestyle=style,
            linewidth=1.6 if i == 0 else 0.9,
            marker="o" if i == 0 else "",
            markersize=3.5,
            zorder=4 - 0.1 * i,
        )
    label_near(axes, points.distance / scale.factor, bounds, "\u00b12 standard deviations", color=QUIET, size=7.5)
    for i, fit in enumerate(report.fits):
        order = np.argsort(-np.abs(fit.residuals), kind="stable")
        label_near(
            axes,
            fit.distances[order] / scale.factor,
            fit.residuals[order],
            fit.model,
            color=CURVES[i % len(CURVES)][0],
            weight="bold" if i == 0 else "normal",
            size=7.5,
            reach=34.0,
        )


def _begin(axes: Axes, report: CalibrationReport, title: str, *, zoom: bool = False) -> Scale:
    """Set the title and the distance axis of a plot; with `zoom`, show only the usable distance range."""
    distances = report.calibration.distances
    scale = scale_for("m", float(distances.max()))
    axes.locator_params(nbins=6)
    axes.set_title(title, y=1.0)
    axes.set_xlabel(f"distance l [{scale.unit}]")
    window = np.array(report.window.distances)
    axes.set_xlim(*span((window if zoom else distances) / scale.factor, 0.06))
    if len(window) and not zoom:
        axes.axvspan(window[0] / scale.factor, window[-1] / scale.factor, color=_WINDOW, linewidth=0, zorder=0)
    return scale


def _unit(report: CalibrationReport) -> str:
    """Return the unit of the sensor output; characters that the font lacks become question marks."""
    plain = "".join(c if ord(c) < 0x250 or c in "\u00b5\u03bc\u2126\u03a9" else "?" for c in report.calibration.unit)
    return plain.strip() or "1"


def _curves(report: CalibrationReport) -> Iterator[tuple[SensorFit, FloatArray, str, Any, float]]:
    """Yield each fitted curve with its distances and line style; the best fit comes last."""
    for i, fit in reversed(list(enumerate(report.fits))):
        low, high = fit.sensor.valid_range
        first, last = max(low, report.window.l_min), min(high, report.window.l_max)
        color, style = CURVES[i % len(CURVES)]
        yield fit, np.linspace(first, last, _FINE), color, style, 1.9 if i == 0 else 1.1


def _points(report: CalibrationReport) -> _Points:
    """Return the averaged readings of the best fit, computed from its curve and its residuals."""
    fit = report.fits[0]
    distance = np.asarray(fit.distances)
    log_output = np.asarray(fit.sensor.log_output(distance)) + fit.residuals
    repeats = np.array([max(1, int(np.sum(report.calibration.distances == d))) for d in distance])
    signal = np.exp(log_output)
    return _Points(distance, log_output, fit.noise.of_means(repeats, signal) / signal)


def _draw_points(axes: Axes, x: FloatArray, y: FloatArray, spread: FloatArray) -> None:
    low, high = axes.get_ylim()
    floor = np.maximum(y - spread[0], low / 10 if axes.get_yscale() == "log" else -np.inf)
    axes.vlines(x, floor, y + spread[1], color=INK, linewidth=0.8, zorder=3.5)
    axes.set_ylim(low, high)
    axes.plot(x, y, "o", color=INK, markerfacecolor="white", markersize=4.0, zorder=4)


def _levels(report: CalibrationReport) -> Iterator[tuple[float, str, Any, tuple[float, float] | None, int]]:
    """Yield offset, floor and clipping level of a calibration, with name, line style and interval."""
    window, offset = report.window, report.offset
    if offset is not None:
        spread = (offset.low, offset.high) if np.isfinite([offset.low, offset.high]).all() else None
        yield offset.value, f"offset, {offset.kind}", "-", spread, -1
    if np.isfinite(window.floor):
        yield window.floor, "floor of the signal", (0, (4, 2)), None, 1
    if window.saturation is not None:
        yield window.saturation, "clipping level", ":", None, 1


def _groups(report: CalibrationReport) -> Iterator[tuple[str, BoolArray, str, str, str]]:
    """Yield groups of calibration readings by their use, such as outliers, with marker and color."""
    distances, outputs = report.calibration.distances, report.calibration.outputs
    window = report.window
    outlier = np.zeros(len(outputs), dtype=np.bool_)
    if report.best is not None and report.best.outliers:
        outlier[list(report.best.outliers)] = True
    clipped = outputs >= (np.inf if window.saturation is None else window.saturation)
    used = np.isin(distances, window.distances) & ~outlier & ~clipped
    faint = ~used & ~outlier & ~clipped & (outputs <= window.floor)
    rest = ~used & ~outlier & ~clipped & ~faint
    for name, mask, marker, color, fill in (
        ("", used, "o", INK, "white"),
        ("outlier, not used", outlier & ~clipped, "X", BASELINE, BASELINE),
        ("clipped", clipped, "s", BASELINE, "white"),
        ("no signal", faint, "v", QUIET, "white"),
        ("outside the window", rest, "D", QUIET, "white"),
    ):
        if mask.any():
            yield name, mask, marker, color, fill


def _draw_curves(axes: Axes, report: CalibrationReport, scale: Scale, value: Any, *, named: bool = False) -> None:
    """Draw all fitted sensor curves and, with `named`, write their names, the best fit first."""
    curves = [
        (distance / scale.factor, value(fit, distance), fit.model, *look) for fit, distance, *look in _curves(report)
    ]
    for x, y, _, color, style, width in curves:
        axes.plot(x, y, color=color, linestyle=style, linewidth=width, zorder=3)
    for i, (x, y, model, color, *_) in enumerate(reversed(curves if named else [])):
        places = np.roll((np.linspace(0.04, 0.96, 24) * (len(x) - 1)).astype(int), -5 * i)
        weight = "bold" if i == 0 else "normal"
        label_near(axes, x[places], np.asarray(y)[places], model, color=color, weight=weight, size=7.5, reach=52.0)
