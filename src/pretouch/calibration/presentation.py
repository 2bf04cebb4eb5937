"""Reports that a person reads: aligned text for terminals, a small table for notebooks."""

from __future__ import annotations

import html
import math

from pretouch._core.units import format_quantity

from .result import CalibrationReport, Estimate, SensorFit

__all__ = ["fit_text", "report_html", "report_text"]

_HEADER = ("model", "RMS ln xi", "RMS slope", "left out", "AICc", "runs p", "R^2 on xi")
_UNITS = ("", "", "[1/m]", "(ln xi)", "", "", "")


def report_text(report: CalibrationReport) -> str:
    """Write a report as aligned text."""
    lines = [report.calibration.name, f"verdict: {report.verdict}", *(f"  - {reason}" for reason in report.reasons), ""]
    lines += _conditions(report)
    if report.fits:
        rows = [_HEADER, _UNITS, *(_row(fit) for fit in report.fits)]
        widths = [max(len(row[i]) for row in rows) for i in range(len(_HEADER))]
        lines.append("")
        lines += [
            "  ".join(
                cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
            for row in rows
        ]
    lines += [f"{name}: not fitted. {reason}" for name, reason in report.not_fitted.items()]
    if report.best is not None:
        lines += ["", fit_text(report.best)]
    return "\n".join(lines)


def fit_text(fit: SensorFit) -> str:
    """Write one fit as aligned text: every parameter with its standard error and interval."""
    estimates = {**fit.parameters, "slope in the middle": fit.middle_slope}
    width = max(len(name) for name in estimates)
    lines = [f"{fit.model}, {len(fit.distances)} distances, {_range(fit)}"]
    lines += [f"  {name.ljust(width)}  {_interval(estimate)}" for name, estimate in estimates.items()]
    return "\n".join([*lines, *(f"  {text}" for text in (*fit.identifiable, *fit.warnings))])


def report_html(report: CalibrationReport) -> str:
    """Write a report as a small HTML table."""
    head = "".join(
        f"<th>{html.escape(f'{name} {unit}'.strip())}</th>" for name, unit in zip(_HEADER, _UNITS, strict=True)
    )
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in _row(fit)) + "</tr>" for fit in report.fits
    )
    reasons = "".join(f"<li>{html.escape(reason)}</li>" for reason in report.reasons)
    conditions = "<br>".join(html.escape(line) for line in _conditions(report))
    return (
        f"<div><b>{html.escape(report.calibration.name)}: {html.escape(report.verdict)}</b><ul>{reasons}</ul>"
        f"<p>{conditions}</p><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _conditions(report: CalibrationReport) -> list[str]:
    """Say what all models share: window, offset, noise."""
    window, offset, noise, unit = report.window, report.offset, report.noise, report.calibration.unit
    lines = [
        f"window  {_limits(report)}",
        f"        starts: {window.start_reason}",
        f"        ends:   {window.end_reason}",
    ]
    if offset is not None:
        lines.append(f"offset  {offset.value:.4g} ± {f'{offset.standard_error:.2g} {unit}'.rstrip()} ({offset.kind})")
    if noise is not None:
        lines.append(f"noise   {f'{noise.output:.3g} {unit}'.rstrip()} per reading, from {noise.output_source};")
        lines.append(f"        {100 * noise.relative:.2g} % of the signal per reading, from {noise.relative_source}")
        size = f"{100 * noise.misfit:.2g} % of the signal, alike over {format_quantity(noise.misfit_length, 'm', 2)}"
        lines.append(f"misfit  {size if noise.misfit > 0 else 'none beyond the noise'}")
    if report.slope is not None:
        known, (near, far) = report.slope, (format_quantity(float(d), "m", 3) for d in report.slope.distances[[0, -1]])
        size = _size(float(known.uncertainty.max()))
        lines.append(f"g       known to {size} from {near} to {far}, whatever the model")
    lines += [f"{'left out' if i == 0 else '        '}  {text}" for i, text in enumerate(report.left_out)]
    return lines


def _size(share: float) -> str:
    """Write a relative uncertainty, which may be a factor."""
    return f"{100 * share:.2g} %" if share < 1 else f"a factor of {1 + share:.2g}"


def _limits(report: CalibrationReport) -> str:
    if not report.window.distances:
        return "none"
    low, high = (format_quantity(d, "m") for d in (report.window.l_min, report.window.l_max))
    return f"{low} to {high}"


def _range(fit: SensorFit) -> str:
    low, high = (format_quantity(d, "m") for d in fit.sensor.valid_range)
    return f"valid from {low} to {high}"


def _row(fit: SensorFit) -> tuple[str, ...]:
    numbers = (fit.rmse_log_output, fit.rmse_log_slope, fit.cross_validation, fit.aicc, fit.runs_p_value)
    formats = ("{:.4f}", "{:.2f}", "{:.4f}", "{:.2f}", "{:.3f}")
    cells = ["-" if v is None else form.format(v) for v, form in zip(numbers, formats, strict=True)]
    return (fit.model, *cells, f"{fit.r_squared:.5f}")


def _interval(estimate: Estimate) -> str:
    error = "unbounded" if math.isinf(estimate.standard_error) else f"{estimate.standard_error:.2g}"
    low, high = (f"{v:.5g}" for v in (estimate.low, estimate.high))
    return f"{estimate.value:.5g} ± {error} {estimate.unit}".rstrip() + f"   95 %: {low} to {high}"
