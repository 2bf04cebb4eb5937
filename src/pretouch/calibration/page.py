"""Build the report of a sensor calibration.

It shows the verdict on the sensor and the fitted models.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from pretouch._core.blocks import Cell, Code, Listing, Measured, Page, PageSection, PageTable, Paragraph, Picture
from pretouch._core.units import format_percent, format_quantity, supported_digits
from pretouch._core.vocabulary import words_for
from pretouch._core.warning_codes import split_code
from pretouch.sensors.recessed import recess_in_words
from pretouch.tables.dialect import DELIMITERS

from .result import CalibrationReport, Estimate, SensorFit, uncertainty_in_words

Row = tuple[Cell, ...]
_KNOWN = 3.0  # factor up to which the ends of the interval of a known slope differ from its value
_NEXT = "put these lines into the section [sensor] of a scenario file"


def calibration_page(report: CalibrationReport) -> Page:
    """Create the report on a sensor calibration."""
    usable, best = report.verdict == "usable", report.best
    fitted_from_file = best is not None and bool(report.scenario_lines)
    listed = (*report.reasons, *report.notes) if usable else report.notes
    first = (Listing(items=listed, brief=True) if listed else None, _readings(report))
    if best is None:
        blocks: tuple[Any, ...] = (_ranking(report) if report.not_fitted else None,)
    else:
        parameters = tuple(block for fit in report.fits for block in _parameters(fit, report))
        note = Paragraph(
            text=f"Copy these lines into a scenario file to use the fitted {best.model} curve. State the recess if the "
            "sensor is mounted behind the contact surface.",
            quiet=True,
        )
        blocks = (
            _ranking(report),
            PageSection(title="Parameters", titled=True, blocks=parameters),
            PageSection(title="For the scenario file", blocks=(Code(text=_scenario_text(best)), note)),
        )
    return Page(
        kind="Sensor calibration",
        source=report.calibration.name,
        headline=_headline(report),
        status=f"verdict: {report.verdict}",
        good=usable,
        key_figures=tuple(_key_figures(report)),
        warnings=() if usable else report.reasons,
        findings=(*(f"left out: {text}" for text in report.left_out), *report.notes),
        next_step=_NEXT if fitted_from_file else "",
        next_lines=_lines_for_scenario(report) if fitted_from_file else (),
        lead="calibration",
        blocks=(_picture(report), *first, *blocks, PageSection(title="Provenance", blocks=tuple(_provenance(report)))),
    )


def _lines_for_scenario(report: CalibrationReport) -> tuple[str, ...]:
    """Return scenario file lines for this sensor.

    Only the user knows how the sensor is mounted, so the recess is a line to complete.
    """
    if report.window.l_min <= 0:
        return report.scenario_lines
    recess = recess_in_words(report.window.l_min)
    remark = f"state how far the sensor is behind the contact surface: {recess} or more"
    return (*report.scenario_lines, f'# recess = "{recess}"  # {remark}')


def _key_figures(report: CalibrationReport) -> Iterator[tuple[str, Cell]]:
    best, offset, slope = report.best, report.offset, report.slope
    if best is None:
        return
    low, high = (format_quantity(d, "m") for d in (report.window.l_min, report.window.l_max))
    yield "usable distances", f"{low} to {high}"
    middle, unit = best.middle_slope, report.calibration.unit
    yield (
        "slope g at mid-range; " + _interval(middle.low, middle.high, "1/m", 3),
        Measured(middle.value, "1/m"),
    )
    if slope is not None:
        place = format_quantity(slope.worst_anywhere_at, "m", 3)
        decisive = f"{uncertainty_in_words(slope.largest)} up to {format_quantity(slope.decisive, 'm')}"
        more = f"; {decisive}" if slope.largest < slope.largest_anywhere else ""
        covers = f"95 %, {low} to {high}, worst at {place}{more}"
        yield f"largest uncertainty of g; {covers}", uncertainty_in_words(slope.largest_anywhere)
    if offset is not None:
        yield (
            f"offset, {offset.kind}; 95 %: {offset.interval_in_words(unit)}",
            Measured(offset.value, unit, offset.digits()),
        )


def fit_page(fit: SensorFit) -> Page:
    """Create the report on the fit of a single sensor model."""
    low, high = (format_quantity(d, "m") for d in fit.sensor.valid_range)
    headline = f"{fit.model}, {len(fit.distances)} distances, valid from {low} to {high}"
    picture = Picture(
        figure="sensor_fit",
        of=fit,
        name="Fitted points, curve and residuals over the distance",
        caption="Circles: averaged readings that were fitted. Line: the fitted curve.",
    )
    return Page(kind="Sensor fit", headline=headline, blocks=(*_parameters(fit, None), picture), lead="sensor_fit")


def fitted_blocks(report: CalibrationReport, open_lines: tuple[str, ...]) -> tuple[Any, ...]:
    """Create the report section on the sensor calibration.

    The reports of designs and verifications contain this section. `open_lines` has the limits of the calibration for
    the answer.

    Returns:
        The blocks of the section.
    """
    limits = tuple(f"{line[0].upper()}{line[1:]}." for line in open_lines)
    return (
        Paragraph(text=_headline(report)),
        Listing(items=(*report.reasons, *report.notes)) if report.reasons else None,
        Listing(items=limits) if limits else None,
        _picture(report),
        *_readings(report).blocks,
        *_ranking(report).blocks,
        *_provenance(report),
    )


def _headline(report: CalibrationReport) -> str:
    name = report.calibration.name
    if report.verdict == "too few distances":
        return f"{name}: {report.verdict}. {split_code(report.reasons[0])[1].partition(': ')[0]}."
    if report.best is None:
        return f"{name}: the readings contain no usable signal, so they do not determine a sensor curve."
    low, high = (format_quantity(d, "m") for d in (report.window.l_min, report.window.l_max))
    slope = report.best.middle_slope
    distances = f"{low} to {high}" + ("" if report.verdict == "usable" else ", with reservations")
    is_table, interval = report.best.model == "table", ""
    if math.isfinite(slope.high - slope.low):
        families = "" if is_table else ", over all families of curves that fit"
        interval = f" (95 %: {slope.low:.4g} to {slope.high:.4g} 1/m{families})"
    curve = "table through the readings" if is_table else f"{report.best.model} curve"
    if not slope.is_within(_KNOWN):
        return (
            f"{name}: the readings do not determine the slope g in the middle of the usable range, {low} to {high}. "
            f"The {curve} fits best, with g = {slope.value:.4g} 1/m there{interval or ' and an unlimited interval'}."
        )
    return (
        f"{name}: the readings are usable from {distances}. The {curve} fits "
        f"best, with a slope g = {slope.value:.4g} 1/m in the middle of the usable range{interval}."
    )


def _picture(report: CalibrationReport) -> Picture:
    caption = (
        "Readings with offset, floor and clipping level. Logarithm of the signal above the offset. Slope g of this "
        "logarithm, which determines the virtual force, compared with differences of neighboring readings. Residuals "
        "of the models."
    )
    name = "Readings, log signal, slope and residuals over the distance"
    if report.best is None:
        name, caption = "Readings over the distance", "The readings."
    return Picture(figure="calibration", of=report, name=name, caption=caption)


def _readings(report: CalibrationReport) -> PageSection:
    head = ("", "value", "reason, source or meaning")
    table = PageTable(head=head, rows=tuple(_reading_rows(report)), wraps=True, brief=True)
    return PageSection(title="Window, offset and noise", blocks=(table,), opened=True)


def _reading_rows(report: CalibrationReport) -> Iterator[Row]:
    unit, window = report.calibration.unit, report.window
    between = " to ".join(format_quantity(d, "m") for d in (window.l_min, window.l_max)) if window.distances else "none"
    yield "verdict", report.verdict, ""
    yield "window", between, ""
    yield "reason for its start", "", window.start_reason
    yield "reason for its end", "", window.end_reason
    if report.offset is not None:
        o = report.offset
        yield (
            "offset (no-object level)",
            o.in_words(unit, 5),
            f"{o.kind}; 95 % interval {o.interval_in_words(unit, 5)}",
        )
    if report.noise is not None:
        n = report.noise
        yield (
            "noise of one reading",
            Measured(n.output, unit, supported_digits(n.output)),
            f"standard deviation without signal, from {n.output_source}",
        )
        relative = f"standard deviation of one reading relative to the signal; source: {n.relative_source}"
        yield "noise relative to the signal", format_percent(n.relative, 3), relative
        length = f"; correlation length {format_quantity(n.misfit_length, 'm')}" if n.misfit > 0 else ""
        yield (
            "misfit of the curve",
            format_percent(n.misfit, 3),
            f"RMS deviation of averaged readings from the curve, without the contribution of noise{length}",
        )
    if report.slope is not None:
        s = report.slope
        near, decisive, far = (format_quantity(float(d), "m") for d in (s.distances[0], s.decisive, s.distances[-1]))
        yield (
            "uncertainty of g (95 %)",
            uncertainty_in_words(s.largest, 3),
            f"from {near} to {decisive}, {_offset_clause(report)}",
        )
        if s.decisive < s.distances[-1]:
            place = format_quantity(s.worst_anywhere_at, "m", 3)
            where = f"from {near} to {far}, largest at {place}; includes the uncertainty of the offset"
            yield "in the whole usable range", uncertainty_in_words(s.largest_anywhere, 3), where
    if (influence := _largest_influence(report.best)) is not None:
        yield influence
    if report.noise is not None and report.noise.resolution > 0:
        step = report.noise.resolution
        yield "resolution", Measured(step, unit, supported_digits(step)), "smallest step between outputs"
    meaning = "readings below it cannot be distinguished from the offset"
    floor = float(window.floor)
    above = floor - report.offset.value if report.offset is not None else 0.0
    yield "floor of the signal", Measured(floor, unit, supported_digits(floor, abs(above))), meaning
    if window.saturation is not None:
        level = float(window.saturation)
        yield "clipping level", Measured(level, unit, supported_digits(level)), "readings at or above it are not used"
    for text in report.left_out:
        yield "left out", "", text


def _largest_influence(fit: SensorFit | None) -> Row | None:
    """Return the distance whose readings decide the slope at the nearest distance; None if it is unknown."""
    if fit is None or not fit.influences:
        return None
    index = max(range(len(fit.influences)), key=lambda i: abs(fit.influences[i]))
    place, nearest = (format_quantity(float(fit.distances[i]), "m") for i in (index, 0))
    change = f"{'+' if fit.influences[index] > 0 else ''}{format_percent(fit.influences[index])}"
    return (
        "distance with the largest influence",
        place,
        f"without the readings there, g at {nearest} would change by {change}; repeat them first, if you repeat any",
    )


def _offset_clause(report: CalibrationReport) -> str:
    """Return a clause that names the offsets that the uncertainty of the sensor slope covers."""
    offset, unit = report.offset, report.calibration.unit
    if offset is None:
        return "over all curves that fit the readings"
    if offset.kind == "fitted":
        return "over all curves that fit, and the 95 % interval of the fitted offset"
    error = f" \u00b1 {offset.error_in_words}" if offset.standard_error else ""
    value = f"{offset.value:.{offset.digits()}g}{error} {unit}".rstrip()
    return f"if the offset is {value}, over all curves that fit"


def _ranking(report: CalibrationReport) -> PageSection:
    head = ("model", "RMSE ln \u03be", "RMSE g [1/m]", "left out, ln \u03be", "AICc", "runs p", "R\u00b2 on \u03be")
    note = (
        "Ranked by AICc. The virtual force follows from ln \u03be and its slope, so their RMS errors show how good a "
        'curve is. "Left out" is the cross-validation error, at distances left out of the fit one by one. R\u00b2 on '
        "\u03be is for comparison with the letter; it hides a wrong offset. A small p of the runs test means that the "
        "residuals have a pattern that the curve does not follow."
    )
    table = PageTable(head=head, rows=tuple(map(_ranking_row, report.fits)), note=note, brief=True)
    missing = tuple(f"{model}: not fitted. {reason}" for model, reason in report.not_fitted.items())
    others = Listing(items=missing, brief=True) if missing else None
    return PageSection(title="Ranking", blocks=(table if report.fits else None, others))


def _ranking_row(fit: SensorFit) -> Row:
    numbers = (fit.rmse_log_output, fit.rmse_log_slope, fit.cross_validation)
    criteria = (
        "-" if v is None else form.format(v) for v, form in ((fit.aicc, "{:.2f}"), (fit.runs_p_value, "{:.2g}"))
    )
    return fit.model, *(Measured(v, "", 3) for v in numbers), *criteria, f"{fit.r_squared:.5f}"


def _parameters(fit: SensorFit, report: CalibrationReport | None) -> tuple[Any, ...]:
    unit, first = "" if report is None else report.calibration.unit, report is None or fit is report.best
    rows = [_parameter_row(name, estimate, unit) for name, estimate in fit.parameters.items()]
    rows.append(_parameter_row("slope g in the middle of the window", fit.middle_slope, ""))
    table = PageTable(head=(fit.model, "value", "standard error", "95 % interval"), rows=tuple(rows), brief=first)
    notes = (*fit.unidentifiable, *(w for w in fit.warnings if w not in fit.unidentifiable))
    return (table, Listing(items=notes, brief=first)) if notes else (table,)


def _parameter_row(name: str, estimate: Estimate, output_unit: str) -> Row:
    unit = estimate.unit or (output_unit if name == "scale" else "")
    value, error = estimate.value, estimate.standard_error
    shown = "unbounded" if math.isinf(error) else Measured(error, unit, supported_digits(error, least=2))
    digits = supported_digits(value, least=5)
    return words_for(name), Measured(value, unit, digits), shown, _interval(estimate.low, estimate.high, unit)


def _interval(low: float, high: float, unit: str, digits: int = 5) -> str:
    if not (math.isfinite(low) or math.isfinite(high)):
        return "no bounds"
    return " to ".join(format_quantity(v, unit, supported_digits(v, least=digits)) for v in (low, high))


def _scenario_text(fit: SensorFit) -> str:
    """Write the fitted sensor curve as scenario file section `[sensor]`."""
    lines = ["[sensor]", f'model = "{fit.model}"']
    if fit.model == "table":
        sensor: Any = fit.sensor
        lines += [f"{key} = {[float(v) for v in getattr(sensor, key)]}" for key in ("distances", "outputs")]
    lines += [f"{name} = {float(value)!r}" for name, value in fit.sensor.parameters.items()]
    start, end = fit.window.l_min, fit.window.l_max
    if start > 0:
        lines += [
            f"minimum_distance = {start:.6g}  # usable distances from the sensor [m]",
            f"maximum_distance = {end:.6g}",
            f"# If the sensor is mounted {recess_in_words(start)} behind the contact surface, use these lines instead:",
            f"# recess = {start!r}",
            f"# maximum_distance = {end - start:.6g}",
        ]
    else:
        lines.append(f"maximum_distance = {end:.6g}  # largest usable distance from the contact surface [m]")
    return "\n".join(lines)


def _provenance(report: CalibrationReport) -> Iterator[Any]:
    source = report.calibration.source
    yield PageTable(rows=tuple(_source_rows(report)), wraps=True)
    if source is not None and source.notes:
        yield Listing(items=tuple(source.notes))


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
        delimiter = DELIMITERS.get(s.delimiter, s.delimiter)
        mark = {".": "point", ",": "comma"}.get(s.decimal_mark, s.decimal_mark)
        yield "read as", f"{s.encoding}, columns separated by {delimiter}, decimal {mark}"
