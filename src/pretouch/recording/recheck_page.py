"""Describe whether a calibration still holds, for the terminal and the report."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from pretouch._core.blocks import Cell, Measured, Page, PageSection, PageTable, Paragraph, Picture
from pretouch._core.units import format_percent, format_quantity
from pretouch._core.vocabulary import words_for
from pretouch._core.warning_codes import split_code

from .replay_page import replay_warnings

if TYPE_CHECKING:
    from .calibration_recheck import Recheck

Row = tuple[Cell, ...]

_OF_THE_ROBOT: Final = ("PT605", "PT608", "PT609")  # warnings that the verdict replaces
_SLOWER: Final = 0.95  # of the rate of the scenario
_LARGE: Final = 0.3  # change of the signal that has a cause to look for
_UPDATE: Final = "write these lines into the scenario file, remove offset from [controller] if it has one"
_UPDATE_FIRST: Final = (
    "write these lines into the scenario file and remove offset from [controller] if it has one, because the offset "
    "was measured, whatever the curve is"
)
_EXACT: Final = 1e-6  # relative error that is only one of rounding
_DAY: Final = 86400.0  # s
_STATUS: Final = {
    "fine": "fine",
    "update-offset": "update the offset",
    "recalibrate": "recalibrate",
    "not-decided": "not decided",
}
_HEAD: Final = ("", "today", "calibration")
_REST: Final = (
    "The contact speeds are those of the encounter of the scenario on its sampled loop without noise. Ranges are three "
    "standard errors. They contain the errors of the readings, of the offset and of the known distances, for each "
    "explanation of the change with which the readings agree: up to three, which differ nearer than the nearest known "
    "distance. They hold for the recorded object: one with another size or tilt has another curve. They do not contain "
    "the uncertainty of the calibration itself, which `pretouch verify` tests."
)


def recheck_page(check: Recheck) -> Page:
    """Return the report on a calibration that was checked.

    Args:
        check: the result.
    """
    return Page(
        kind="Check of a calibration",
        headline=check.headline,
        status=_STATUS[check.decision],
        good=check.is_good,
        key_figures=tuple(_key_figures(check)),
        warnings=tuple(_warnings(check)),
        findings=tuple(_findings(check)),
        next_step=_next_step(check),
        next_lines=_next_lines(check),
        lead="replay",
        blocks=(
            Picture(
                figure="replay",
                of=check.replay,
                name="Readings, sensor output, virtual force and commanded motion over time",
                caption="Each point of time shows the smallest and the largest value around it. Shaded: detections.",
            ),
            _distances(check),
            PageSection(
                title="Today and then",
                blocks=(PageTable(rows=tuple(_rows(check)), head=_HEAD, brief=True),),
                opened=True,
            ),
            Paragraph(text=_REST, quiet=True),
        ),
        source=check.replay.recording.source,
    )


def _key_figures(check: Recheck) -> Iterator[tuple[str, Cell]]:
    if check.offset is not None:
        yield f"offset; calibration {_offset_then(check)}", _with_error(check.offset, check.offset_error)
    if check.slope is not None and check.slope_then is not None:
        where = f"{format_quantity(check.places[0], 'm', 3)} to {format_quantity(check.places[-1], 'm', 3)}"
        then = format_quantity(check.slope_then, "1/m", 3)
        yield (
            f"mean slope g from {where}; calibration {then}",
            f"{_with_error(check.slope, check.slope_error)} 1/m",
        )
        near = 100 * math.expm1(check.ratios[0])
        error = 100 * math.exp(check.ratios[0]) * check.ratio_errors[0]
        where = format_quantity(check.places[0], "m", 3)
        yield f"signal at {where}; change since the calibration", f"{_with_error(near, error, '+')} %"
    noise, chain = check.replay.noise.noise, check.replay.loop.chain
    if noise is not None:
        where, unit = "with" if check.replay.noise.limited else "without", check.replay.recording.unit
        yield (
            f"noise {where} an object; scenario {chain.noise:.3g}",
            f"{noise:.3g} {unit or '(unit of the readings)'}",
        )


def _warnings(check: Recheck) -> Iterator[str]:
    """Yield the warnings of the replay that a verdict does not replace."""
    moves, rate = any(each.span for each in check.distances), check.replay.loop.chain.rate
    # the pauses between the distances are no missing readings
    paused = () if moves or check.replay.timing.value_rate < _SLOWER * rate else ("PT606",)
    for text in replay_warnings(check.replay if moves else replace(check.replay, latency=None)):
        if split_code(text)[0] not in (*_OF_THE_ROBOT, *paused):
            yield text


def _with_error(value: float, error: float, sign: str = "") -> str:
    """Return a value with its standard error, which has two digits, as text. `sign` is "+" for changes."""
    if not _EXACT * abs(value) < error < math.inf:
        return f"{value:{sign}.6g}"
    decimals = max(1 - math.floor(math.log10(error)), 0)
    return f"{value:{sign}.{decimals}f} ± {error:.{decimals}f}"


def _offset_then(check: Recheck) -> str:
    error = check.offset_then_error
    return _with_error(check.offset_then, error) if error else f"{check.offset_then:.6g}"


def _findings(check: Recheck) -> Iterator[str]:
    if check.interval is not None and check.elapsed is not None:
        seen = f"at the drift of the last {_days(check.elapsed)}, half of the allowed change is used up then"
        why = seen if check.interval < check.elapsed else "the contact speed has hardly changed"
        yield (
            f"Check again after {_days(check.interval)} at the latest: {why}. One interval of drift supports no longer "
            "time than itself."
        )
    then, now = check.optimal_gain_then, check.optimal_gain
    if check.decision == "recalibrate" and then is not None and now is not None:
        yield (
            f"With the curve of today, the optimal {check.number.name} is about {check.number.text(now, 2)} instead of "
            f"{check.number.text(then, 3)}; only a new calibration is exact enough to use it."
        )
    if check.is_good and check.updates_offset and check.offset is not None:
        yield (
            f"The offset has changed by more than half of the noise floor: set offset = {check.offset:.6g} in [chain], "
            "so that objects are detected as far away as before."
        )
    for name in check.limits:
        yield (
            f"The limit of the {words_for(name)} held at the contact speed of the calibration, but the range of today "
            "exceeds it: put the offset of today into [chain], and run pretouch verify."
        )
    if check.ratios and abs(math.expm1(check.ratios[0])) - 2 * check.ratio_errors[0] > _LARGE:
        yield (
            f"The signal has changed by {100 * math.expm1(check.ratios[0]):+.2g} %: look for the cause (dust, another "
            "object, the emitter), even if the contact stays as it was."
        )
    if check.offset is not None and check.offset_then_error is None:
        yield "The uncertainty of the old offset is unknown, because the scenario states it as a number."


def _days(time: float) -> str:
    return f"{time / _DAY:.2g} days" if time >= _DAY else format_quantity(time, "s", 3)


def _next_step(check: Recheck) -> str:
    match check.decision:
        case "fine" if check.interval is not None:
            return f"check again after {_days(check.interval)}"
        case "fine":
            return "check again later; with the time since the calibration (--elapsed), pretouch recommends when"
        case "update-offset":
            return f"{_UPDATE}, and run pretouch verify and pretouch export again"
        case "recalibrate" if not check.actions:
            return "record a new calibration (pretouch record), then run pretouch fit, design and verify"
    actions = "; ".join(check.actions)
    return f"{_UPDATE_FIRST}; then {actions}" if check.updates_offset else actions


def _next_lines(check: Recheck) -> tuple[str, ...]:
    if not check.updates_offset or check.is_good or check.offset is None:
        return ()
    crosstalk = ("crosstalk = 0",) if check.replay.loop.chain.crosstalk else ()
    return ("[chain]", f"offset = {float(f'{check.offset:.6g}')!r}", *crosstalk)


def _distances(check: Recheck) -> PageSection | None:
    if not check.distances:
        return None
    ratios = dict(zip(check.places, zip(check.ratios, check.ratio_errors, strict=True), strict=True))
    rows = []
    for each in check.distances:
        ratio, error = ratios.get(each.distance, (math.nan, math.nan))
        rows.append(
            (
                "no object" if math.isinf(each.distance) else format_quantity(each.distance, "m"),
                f"{each.count:,}",
                _with_error(each.reading, each.error),
                f"{each.signal:.4g}" if each.signal > 0 else "-",
                "-"
                if math.isnan(ratio)
                else f"{_with_error(100 * math.expm1(ratio), 100 * math.exp(ratio) * error, '+')} %",
            )
        )
    head = ("distance", "readings", "mean reading", "\u03be of the calibration", "change of \u03be")
    return PageSection(title="Known distances", blocks=(PageTable(rows=tuple(rows), head=head, brief=True),))


def _rows(check: Recheck) -> Iterator[Row]:
    timing, noise, chain = check.replay.timing, check.replay.noise, check.replay.loop.chain
    if check.offset is not None:
        yield "offset", _with_error(check.offset, check.offset_error), _offset_then(check)
    if check.slope is not None:
        slope = f"{_with_error(check.slope, check.slope_error)} 1/m"
        yield "mean slope g between the known distances", slope, Measured(check.slope_then, "1/m")
    if check.contact_then is not None:
        then = Measured(check.contact_then, "m/s", 3)
        yield "contact speed, controller as it is", "unknown" if check.contact is None else check.contact.words, then
        updated = "unknown" if check.contact_updated is None else check.contact_updated.words
        yield "contact speed, offset updated", updated, then
    yield f"{check.number.label}, checked", "", Measured(check.gain, check.number.unit)
    if check.optimal_gain_then is not None:
        gains = (Measured(gain, check.number.unit) for gain in (check.optimal_gain, check.optimal_gain_then))
        yield f"optimal {check.number.label}, ideal loop", *gains
    yield "noise without an object", Measured(noise.noise), Measured(chain.noise)
    yield "rate of new values", Measured(timing.value_rate, "Hz"), Measured(chain.rate, "Hz")
    if check.elapsed is not None and check.offset is not None:
        drift = (check.offset - check.offset_then) * _DAY / check.elapsed
        yield "drift of the offset", f"{drift:+.3g} per day", ""
        if check.contact is not None and check.contact_then is not None:
            change = check.contact.value / check.contact_then - 1
            yield "drift of the contact speed", f"{'+' if change > 0 else ''}{format_percent(change)}", ""
