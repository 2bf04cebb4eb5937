"""What a calibration report says, section by section, as plain rows of text for the template."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from .wording import number, quantity, word

if TYPE_CHECKING:
    from pretouch.calibration.result import CalibrationReport, Estimate, SensorFit

__all__ = ["fit_page"]

Row = tuple[str, ...]


def fit_page(report: CalibrationReport) -> dict[str, Any]:
    """Collect the text of a calibration report.

    Args:
        report: a report of any verdict.

    Returns:
        The template's variables, all text.
    """
    best = report.best
    return {
        "name": report.calibration.name,
        "verdict": report.verdict,
        "headline": _headline(report),
        "reasons": list(report.reasons),
        "reading_rows": list(_reading_rows(report)),
        "ranking_rows": [_ranking_row(i, fit) for i, fit in enumerate(report.fits)],
        "not_fitted": [(model, reason) for model, reason in report.not_fitted.items()],
        "fits": [_fit(fit, report.calibration.unit) for fit in report.fits],
        "scenario_text": "" if best is None else _scenario_text(best),
        "best": None if best is None else best.model,
        "source_rows": list(_source_rows(report)),
        "source_notes": [] if report.calibration.source is None else list(report.calibration.source.notes),
    }


def _headline(report: CalibrationReport) -> str:
    if report.best is None:
        return "No usable signal: these readings do not determine a sensor curve."
    low, high = (quantity(d, "m") for d in (report.window.l_min, report.window.l_max))
    slope = report.best.middle_slope
    spread = "" if not math.isfinite(slope.standard_error) else f" \u00b1 {slope.standard_error:.2g}"
    reserve = "" if report.verdict == "usable" else ", with the reservations below"
    return (
        f"Usable from {low} to {high}{reserve}: the {report.best.model} curve ranks first, with a slope "
        f"g = {slope.value:.4g}{spread} 1/m in the middle of the window."
    )


def _reading_rows(report: CalibrationReport) -> Iterator[Row]:
    unit, window = report.calibration.unit, report.window
    if window.distances:
        yield "usable window", f"{quantity(window.l_min, 'm')} to {quantity(window.l_max, 'm')}", ""
    else:
        yield "usable window", "none", ""
    yield "it starts there because", "", window.start_reason
    yield "it ends there because", "", window.end_reason
    if report.offset is not None:
        o = report.offset
        yield (
            "offset (no-object level)",
            _spread(o.value, o.standard_error, unit),
            f"{o.kind}; 95 % interval {_interval(o.low, o.high, unit)}",
        )
    if report.noise is not None:
        n = report.noise
        yield "noise of one reading", _value(n.output, unit), n.output_source
        yield "noise relative to the signal", f"{100 * n.relative:.3g} %", f"per reading, from {n.relative_source}"
        length = f"of the mean, alike over {quantity(n.misfit_length, 'm')}" if n.misfit > 0 else ""
        yield "misfit of the curve", f"{100 * n.misfit:.3g} %", length or "none beyond the noise"
    if report.slope is not None:
        places = [quantity(float(d), "m") for d in report.slope.distances[[0, -1]]]
        worst = 100 * float(report.slope.uncertainty.max())
        yield (
            "g is known to",
            f"{worst:.3g} %",
            f"from {places[0]} to {places[1]}, over all curves that the readings allow",
        )
    if report.noise is not None:
        n = report.noise
        if n.resolution > 0:
            yield "resolution", _value(n.resolution, unit), "smallest step between outputs"
    yield "floor of the signal", _value(window.floor, unit), "below it a reading does not tell a signal from the offset"
    if window.saturation is not None:
        yield "clipping level", _value(window.saturation, unit), "readings there are not used"
    for text in report.left_out:
        yield "left out", "", text


def _ranking_row(index: int, fit: SensorFit) -> Row:
    return (
        f"{index + 1}. {fit.model}",
        number(fit.rmse_log_output, 3),
        number(fit.rmse_log_slope, 3),
        number(fit.cross_validation, 3),
        "\u2013" if fit.aicc is None else f"{fit.aicc:.1f}",
        "\u2013" if fit.runs_p_value is None else f"{fit.runs_p_value:.2g}",
        f"{fit.r_squared:.5f}",
    )


def _fit(fit: SensorFit, unit: str) -> dict[str, Any]:
    rows = [_parameter_row(name, estimate, unit) for name, estimate in fit.parameters.items()]
    rows.append(_parameter_row("slope g in the middle of the window", fit.middle_slope, ""))
    return {
        "model": fit.model,
        "rows": rows,
        "notes": [*fit.identifiable, *(w for w in fit.warnings if w not in fit.identifiable)],
    }


def _parameter_row(name: str, estimate: Estimate, output_unit: str) -> Row:
    unit = estimate.unit or (output_unit if name == "scale" else "")
    error = "unbounded" if math.isinf(estimate.standard_error) else quantity(estimate.standard_error, unit, 2)
    return word(name), quantity(estimate.value, unit, 5), error, _interval(estimate.low, estimate.high, unit)


def _interval(low: float, high: float, unit: str) -> str:
    if not (math.isfinite(low) or math.isfinite(high)):
        return "no bounds"
    return f"{quantity(low, unit)} to {quantity(high, unit)}"


def _value(value: float, unit: str) -> str:
    return quantity(float(value), unit)


def _spread(value: float, error: float, unit: str) -> str:
    return f"{value:.5g} \u00b1 {error:.2g} {unit}".strip()


def _scenario_text(fit: SensorFit) -> str:
    """Write the best curve as it stands in a scenario file; the contact surface is where the window starts."""
    lines = ["[sensor]", f'model = "{fit.model}"']
    if fit.model == "table":
        sensor: Any = fit.sensor
        lines += [f"{key} = {[float(v) for v in getattr(sensor, key)]}" for key in ("distances", "outputs")]
    lines += [f"{name} = {float(value)!r}" for name, value in fit.sensor.parameters.items()]
    start, end = fit.window.l_min, fit.window.l_max
    if start > 0:
        lines.append(f"recess = {start!r}  # the sensor sits this far behind the contact surface [m]")
    lines.append(f"maximum_distance = {end - start:.6g}  # from the contact surface [m]")
    return "\n".join(lines)


def _source_rows(report: CalibrationReport) -> Iterator[Row]:
    c = report.calibration
    yield "readings", str(len(c.outputs))
    yield "distances", str(len(c.distinct_distances))
    yield "no-object readings", str(len(c.no_object))
    if c.label:
        yield "curve", c.label
    if c.source is not None:
        s = c.source
        yield "file", s.file
        yield "SHA-256", s.sha256
        yield "columns", f"{s.distance_column} and {s.output_column}"
        yield "rows, of which dropped", f"{s.rows}, {s.dropped}"
        delimiter = {"\t": "tab", " ": "space"}.get(s.delimiter, s.delimiter)
        yield "read as", f"{s.encoding}, columns separated by {delimiter}, decimal mark {s.decimal_mark}"
