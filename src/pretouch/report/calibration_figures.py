"""Plot a sensor calibration: readings, fitted curves, slopes and residuals."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.numbers import BoolArray, FloatArray

from .new_figure import new_figure
from .style import BASELINE, CURVES, INK, LIMIT, QUIET, Scale, drawing, log_axis, scale_for, span

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pretouch.calibration.result import CalibrationReport, SensorFit


_WINDOW: Final = "#eef4f9"
_FINE: Final = 120
_TWO_SIGMA: Final = 2.0
_BARS: Final = "\u00b12 standard deviations"
_ROOM: Final = 5.9  # inch, width of all panels of a row


class _Points(NamedTuple):
    """Averaged calibration readings with the standard deviation of their log output."""

    distance: FloatArray
    log_output: FloatArray
    deviation: FloatArray


@check_arguments
def calibration(report: CalibrationReport) -> Figure:
    """Draw the readings of a calibration and the fitted sensor curves.

    Args:
        report: a report with any verdict.

    Returns:
        Four panels over the distance: the readings with offset, clipping level, floor and usable window; the signal
        above the offset on a logarithmic axis; its slope g compared with difference quotients of the readings; and the
        residuals of ln xi. Without a usable signal, only the panel of readings.
    """
    with drawing():
        from matplotlib.lines import Line2D  # noqa: PLC0415 - imported when something is drawn, as the next one

        from .panel_drawing import LegendEntry, add_legend  # noqa: PLC0415

        parts: tuple[tuple[str, Any], ...] = ((f"Readings: {report.verdict}", _draw_readings),)
        if report.fits:
            parts = (
                ("Readings and their use", _draw_readings),
                ("Signal, logarithmic", _draw_log_output),
                ("Slope g: the force is D\u209a g l\u2032", _draw_slope),
                ("Residuals of the models", _draw_residuals),
            )
        figure = new_figure(7.4, 7.8 if report.fits else 3.6)
        figure.set_layout_engine("constrained", w_pad=0.06, h_pad=0.06)
        side = 2 if report.fits else 1
        for i, (title, draw) in enumerate(parts):
            axes = figure.add_subplot(side, side, i + 1)
            draw(axes, report)
            handles, labels = axes.get_legend_handles_labels()
            colors = [str(line.get_color()) if isinstance(line, Line2D) else LIMIT for line in handles]
            entries = [LegendEntry(*each) for each in zip(labels, colors, handles, strict=True)]
            add_legend(axes, entries, title, _ROOM / side)
    return figure


def _draw_readings(axes: Axes, report: CalibrationReport) -> None:
    """Draw all calibration readings and the fitted sensor curves."""
    scale = _set_up(axes, report)
    outputs = report.calibration.outputs
    axes.set_ylabel(f"output [{_unit(report)}]", parse_math=False)
    levels = [level for level, *_ in _levels(report)]
    low, high = span(np.array([*outputs, *report.calibration.no_object, *levels]), 0.08)
    axes.set_ylim(low, high)
    for text, mask, marker, color, fill in _groups(report):
        x, y = report.calibration.distances[mask] / scale.factor, outputs[mask]
        axes.plot(x, y, marker, color=color, markerfacecolor=fill, markersize=4.2, label=text, zorder=4)
    _draw_curves(axes, report, scale, lambda fit, distance: fit.offset.value + fit.sensor.output(distance), named=False)
    for level, text, style, spread in _levels(report):
        axes.axhline(level, color=LIMIT, linestyle=style, linewidth=1.0, label=text, zorder=2)
        if spread:
            axes.axhspan(*spread, color="#cfcfcf", linewidth=0, zorder=1)


def _draw_log_output(axes: Axes, report: CalibrationReport) -> None:
    """Draw the sensor readings, minus their offset, on a logarithmic axis."""
    scale = _set_up(axes, report, zoom=True)
    points = _points(report)
    axes.set_ylabel(f"output \u2212 offset [{_unit(report)}], log. axis", parse_math=False)
    value = np.exp(points.log_output)
    low, high = float(value.min()), float(value.max())
    log_axis(axes, "y", low / (high / low) ** 0.12, high * (high / low) ** 0.12)
    spread = value * np.abs(np.expm1(_TWO_SIGMA * np.vstack([-points.deviation, points.deviation])))
    _draw_points(axes, points.distance / scale.factor, value, spread)
    _draw_curves(axes, report, scale, lambda fit, distance: fit.sensor.output(distance))


def _draw_slope(axes: Axes, report: CalibrationReport) -> None:
    """Draw the slope of the log output versus the distance."""
    scale = _set_up(axes, report, zoom=True)
    points = _points(report)
    axes.set_ylabel("slope g = d ln \u03be / dl [1/m]")
    middle = (points.distance[1:] + points.distance[:-1]) / 2
    step = np.diff(points.distance)
    slope = np.diff(points.log_output) / step
    spread = _TWO_SIGMA * np.hypot(points.deviation[1:], points.deviation[:-1]) / step
    fits = [fit for fit in report.fits if fit.model != "table"]
    drawn = np.concatenate([fit.sensor.log_slope(_distances(fit, report)) for fit in fits] or [slope])
    low, high = span(np.concatenate([drawn, slope, [0.0]]))
    reach = 1.2 * (float(drawn.max()) - float(drawn.min())) + 0.35 * float(np.abs(drawn).max())
    axes.set_ylim(max(low, float(drawn.min()) - reach), min(high, float(drawn.max()) + reach))
    axes.axhline(0, color=QUIET, linewidth=0.7, zorder=1.5)
    _draw_points(axes, middle / scale.factor, slope, np.vstack([spread, spread]))
    _draw_curves(axes, report, scale, lambda fit, distance: fit.sensor.log_slope(distance))


def _draw_residuals(axes: Axes, report: CalibrationReport) -> None:
    """Draw the residuals of each fitted sensor curve."""
    scale = _set_up(axes, report, zoom=True)
    points = _points(report)
    axes.set_ylabel("residual of ln \u03be [1]")
    bounds = _TWO_SIGMA * points.deviation
    shown = np.concatenate([report.fits[0].residuals, np.minimum(bounds, 0.5)])  # a bad model leaves the axis
    largest = 1.6 * float(np.max(np.abs(shown))) or 1.0
    axes.set_ylim(-largest, largest)
    axes.axhline(0, color=QUIET, linewidth=0.8, zorder=1.5)
    axes.fill_between(
        points.distance / scale.factor, -bounds, bounds, color="#d9d9d9", linewidth=0, label=_BARS, zorder=1
    )
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
            label=fit.model if np.max(np.abs(fit.residuals)) <= largest else f"{fit.model}, off the axis",
            zorder=4 - 0.1 * i,
        )


def _set_up(axes: Axes, report: CalibrationReport, *, zoom: bool = False) -> Scale:
    """Set the distance axis of a calibration plot."""
    distances = report.calibration.distances
    scale = scale_for("m", float(distances.max()))
    axes.locator_params(nbins=6)
    axes.set_xlabel(f"distance l [{scale.unit}]")
    window = np.array(report.window.distances)
    axes.set_xlim(*span((window if zoom else distances) / scale.factor, 0.06))
    if len(window) and not zoom:
        ends = window[[0, -1]] / scale.factor
        axes.axvspan(*ends, facecolor=_WINDOW, edgecolor=QUIET, linewidth=0, label="usable window", zorder=0)
    return scale


def _unit(report: CalibrationReport) -> str:
    """Return the unit of the sensor output as plot text. Characters that the font lacks become question marks."""
    plain = "".join(c if ord(c) < 0x250 or c in "\u00b5\u03bc\u2126\u03a9" else "?" for c in report.calibration.unit)
    return plain.strip() or "1"


def _distances(fit: SensorFit, report: CalibrationReport) -> FloatArray:
    """Return the distances at which a fitted sensor curve is drawn."""
    low, high = fit.sensor.valid_range
    return np.linspace(max(low, report.window.l_min), min(high, report.window.l_max), _FINE)


def _points(report: CalibrationReport) -> _Points:
    """Compute the averaged calibration readings from the best fit and its residuals."""
    fit = report.fits[0]
    distance = np.asarray(fit.distances)
    log_output = np.asarray(fit.sensor.log_output(distance)) + fit.residuals
    repeats = np.array([max(1, int(np.sum(report.calibration.distances == d))) for d in distance])
    signal = np.exp(log_output)
    return _Points(distance, log_output, fit.noise.of_means(repeats, signal) / signal)


def _draw_points(axes: Axes, x: FloatArray, y: FloatArray, spread: FloatArray) -> None:
    low, high = axes.get_ylim()
    floor = np.maximum(y - spread[0], low / 10 if axes.get_yscale() == "log" else -np.inf)
    axes.vlines(x, floor, y + spread[1], color=INK, linewidth=0.8, label=_BARS, zorder=3.5)
    axes.set_ylim(low, high)
    axes.plot(x, y, "o", color=INK, markerfacecolor="white", markersize=4.0, zorder=4)


def _levels(report: CalibrationReport) -> Iterator[tuple[float, str, Any, tuple[float, float] | None]]:
    """Yield horizontal reference lines, such as offset and noise floor."""
    window, offset = report.window, report.offset
    if offset is not None:
        spread = (offset.low, offset.high) if np.isfinite([offset.low, offset.high]).all() else None
        yield offset.value, f"offset, {offset.kind}", "-", spread
    if np.isfinite(window.floor):
        yield window.floor, "floor of the signal", (0, (4, 2)), None
    if window.saturation is not None:
        yield window.saturation, "clipping level", ":", None


def _groups(report: CalibrationReport) -> Iterator[tuple[str, BoolArray, str, str, str]]:
    """Yield groups of calibration readings with their marker and color."""
    distances, outputs = report.calibration.distances, report.calibration.outputs
    window = report.window
    outlier = np.zeros(len(outputs), dtype=np.bool_)
    if report.best is not None and report.best.outliers:
        outlier[list(report.best.outliers)] = True
    clipped = outputs >= (np.inf if window.saturation is None else window.saturation)
    used = np.isin(distances, window.distances) & ~outlier & ~clipped
    no_signal = ~used & ~outlier & ~clipped & (outputs <= window.floor)
    outside = ~used & ~outlier & ~clipped & ~no_signal
    for name, mask, marker, color, fill in (
        ("used", used, "o", INK, "white"),
        ("outlier, not used", outlier & ~clipped, "X", BASELINE, BASELINE),
        ("clipped", clipped, "s", BASELINE, "white"),
        ("no signal", no_signal, "v", QUIET, "white"),
        ("outside the window", outside, "D", QUIET, "white"),
    ):
        if mask.any():
            yield name, mask, marker, color, fill


def _draw_curves(axes: Axes, report: CalibrationReport, scale: Scale, value: Any, *, named: bool = True) -> None:
    """Draw all fitted sensor curves, with the best one on top."""
    for i, fit in enumerate(report.fits):
        distance = _distances(fit, report)
        color, style = CURVES[i % len(CURVES)]
        width, order = (1.9, 3.2) if i == 0 else (1.1, 3 - 0.01 * i)
        axes.plot(
            distance / scale.factor,
            value(fit, distance),
            color=color,
            linestyle=style,
            linewidth=width,
            label=fit.model if named else "",
            zorder=order,
        )
