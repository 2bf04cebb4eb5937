"""Explain the verdict on a sensor.

List its problems, their remedies, and the excluded readings.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pretouch._core.units import format_percent, format_quantity, supported_digits
from pretouch._core.warning_codes import caution

from .averaging import average
from .data import Calibration
from .preparation import Prepared, is_explained_by_one_error
from .result import SensorFit, SlopeUncertainty
from .slope_uncertainty import slope_reservations, uncertain_slope

if TYPE_CHECKING:
    from .contact_check import WitnessCheck

FEW_POINTS = 6
"""The number of distances below which a reservation is made."""

_MORE_THAN_UNKNOWNS = 3  # distances needed beyond the number of unknowns, to judge a fit
_LARGE_MISFIT = 0.1  # misfit of ln xi; over one step of distance, the virtual force has about this relative error
_PROBABLY_WRONG = 0.5  # probability of a wrong nearest reading from which on a reservation is made
_FEW_EMPTY = 4  # readings without an object from which the noise can be estimated, as from repeats
_DOUBT = {"declared": 1.0, "measured": 3.5, "fitted": 1.0}  # allowed `PossibleCurves.doubt` of each kind of offset
_MOST_NAMED = 5  # readings that a sentence lists
_SMALL_FALL = 0.3  # decrease of ln xi over the window below which only the mean slope is determined


def ignored_readings(prepared: Prepared) -> tuple[str, ...]:
    """Return a sentence for each group of ignored readings.

    The fits ignore readings such as outliers.
    """
    calibration, window, groups = prepared.calibration, prepared.window, []
    at_bad = np.isin(calibration.distances, prepared.outlier_distances)
    single = [i for i in prepared.outliers if not at_bad[i]]
    used = np.delete(calibration.distances, list(prepared.outliers))
    farthest = float(used.max()) if len(used) else math.inf
    beyond = [i for i in single if calibration.outputs[i] == 0 and calibration.distances[i] > farthest]
    alone = [i for i in single if i not in beyond and calibration.distances[i] not in used]
    single = [i for i in single if i not in beyond and i not in alone]
    for indices, meaning in (
        (beyond, "beyond all other readings: no signal there"),
        (alone, "although all other readings are clearly above 0 (dropout)"),
    ):
        if indices:
            places = _list([format_quantity(float(d), "m") for d in np.unique(calibration.distances[indices])])
            groups.append(f"{_readings(len(indices))} of {_level(calibration, 0.0)} at {places}, {meaning}.")
    if single:
        at = (format_quantity(float(calibration.distances[i]), "m") for i in single)
        shown = [f"{_level(calibration, calibration.outputs[i])} at {d}" for i, d in zip(single, at, strict=True)]
        groups.append(
            f"{_readings(len(single))} whose output differs from other readings at the same distance (dropout or "
            f"outlier): {_list(shown)}."
        )
    if prepared.empty_outliers:
        shown = [_level(calibration, output) for output in prepared.empty_outliers]
        groups.append(
            f"{_readings(len(shown))} without an object that deviate{'s' if len(shown) == 1 else ''} from the others: "
            f"{_list(shown)}."
        )
    for distance in prepared.outlier_distances:
        at_distance = calibration.distances == distance
        named = f"{_level(calibration, np.mean(calibration.outputs[at_distance]))} at {format_quantity(distance, 'm')}"
        groups.append(
            f"{_readings(at_distance.sum())} whose output disagrees with every curve through the other readings: "
            f"{named}; measure again."
        )
    if window.distances:
        low, high = window.l_min, window.l_max
        for outside, where, reason in (
            (calibration.distances < low, f"nearer than {format_quantity(low, 'm')}", window.start_reason),
            (calibration.distances > high, f"beyond {format_quantity(high, 'm')}", window.end_reason),
        ):
            if (outside & ~at_bad).any():
                groups.append(f"{_readings((outside & ~at_bad).sum())} {where}: {reason}.")
    return tuple(groups)


def _list(shown: list[str], joint: str = ", ") -> str:
    if len(shown) > _MOST_NAMED:
        return ", ".join([*shown[:_MOST_NAMED], "..."])
    return joint.join([", ".join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)


def _level(calibration: Calibration, output: float) -> str:
    return f"{output:.{supported_digits(output)}g} {calibration.unit}".rstrip()


def _readings(count: Any) -> str:
    return f"{count:,} reading{'s' if count != 1 else ''}"


def summary(prepared: Prepared, fits: list[SensorFit]) -> str:
    """Summarize how well the best sensor model fits."""
    low, high = (format_quantity(d, "m") for d in (prepared.window.l_min, prepared.window.l_max))
    if not fits:
        return f"The sensor signal is usable from {low} to {high}, but none of the requested models fits the readings."
    best, steep_from = fits[0], prepared.steep_from
    flattens = (
        f" The output flattens at distances below {format_quantity(steep_from, 'm')}, but it differs clearly from one "
        "distance to the next."
        if math.isfinite(steep_from)
        else ""
    )
    if best.model == "table":
        return (
            f"The table passes through the readings at {len(best.distances)} distances from {low} to {high}.{flattens}"
        )
    return (
        f"The {best.model} curve was fitted to readings at {len(best.distances)} distances from {low} to {high}. "
        f"Averaged readings deviate from this curve by {format_percent(best.rmse_log_output)} of the signal (RMS, "
        f"including noise).{flattens}"
    )


def find_reservations(prepared: Prepared, fits: list[SensorFit], slope: SlopeUncertainty | None) -> list[str]:
    """Return warnings about readings that contradict each other, the offset or the best model.

    Each warning contains a remedy.
    """
    calibration, window, used = prepared.calibration, prepared.window, prepared.used
    low, high = (format_quantity(d, "m") for d in (window.l_min, window.l_max))
    signal = used.output - (fits[0].offset.value if fits else 0.0)
    fall = float(np.log(signal[0]) - np.log(signal[-1])) if fits else math.inf
    count, bad = len(used.distance), len(prepared.outlier_distances)
    dropped = calibration.source.dropped if calibration.source else 0
    reasons = _offset_contradictions(prepared)
    if bad > 1 + count // 10:
        reasons.append(
            caution(
                "PT104",
                f"The readings at {bad} distances are inconsistent with every curve through the other readings: "
                "measure again at these distances.",
            )
        )
    reasons += _wrong_nearest(prepared)
    if fall < _SMALL_FALL:
        falls = f"the output falls only by a factor of {math.exp(fall):.2g}"
        reasons.append(caution("PT105", f"From {low} to {high} {falls}: measure over a wider range."))
    if dropped > 0.2 * (dropped + len(calibration.outputs)):
        reasons.append(caution("PT106", f"{dropped} rows have no output: check the recording."))
    if fits:
        reasons += slope_reservations(prepared, fits, slope)
        reasons += _misfits(prepared, fits)
    return reasons


def find_weaknesses(
    prepared: Prepared, fits: list[SensorFit], slope: SlopeUncertainty | None, *, reading_count: int
) -> list[str]:
    """Return what the readings lack: distances, repeats, an offset or an accurate slope, each with a remedy.

    They are reservations only if the readings do not determine the contact speed. `reading_count` is the number of
    readings in the file, including copies of readings, which the fits count once.
    """
    calibration, window, used = prepared.calibration, prepared.window, prepared.used
    copies = reading_count - len(calibration.outputs) - len(calibration.no_object) - len(prepared.empty_outliers)
    low, high = (format_quantity(d, "m") for d in (window.l_min, window.l_max))
    count, weaknesses = len(used.distance), []
    unknowns = (len(fits[0].parameters) or 3) + (fits[0].offset.kind == "fitted") if fits else 0
    if count < FEW_POINTS or count - unknowns < _MORE_THAN_UNKNOWNS:
        weaknesses.append(
            caution(
                "PT101",
                f"The usable range has only {count} different distances, but the curve has {unknowns} unknown "
                f"parameters: measure at 8 or more distances. The usable range is from {low} to {high}.",
            )
        )
    if copies:
        weaknesses.append(
            caution(
                "PT115",
                f"{copies} of {reading_count} readings repeat another reading exactly, so they do not show the noise: "
                "remove copies, and record raw readings. Repeated readings are not counted. They may be copies, "
                "averages or readings of a coarse sensor.",
            )
        )
    elif used.count.max() == 1 and len(calibration.no_object) < _FEW_EMPTY:
        once = "Every distance was read once, so the noise is estimated from deviations from the curve"
        weaknesses.append(caution("PT102", f"{once}: read each distance 3 times or more."))
    weaknesses += [*_weak_offset(prepared), *_few_flattened(prepared)]
    return weaknesses + (uncertain_slope(prepared, fits[0], slope) if fits else [])


def contact_reservations(prepared: Prepared, check: WitnessCheck | None) -> list[str]:
    """Return a warning if the readings do not determine the contact speed of a typical encounter."""
    if check is None or check.is_determined:
        return []
    from .contact_check import measurement_that_helps  # noqa: PLC0415 - it loads the motions

    window = prepared.window
    advice = measurement_that_helps(check, prepared.offset, window.l_min, window.l_max)
    low, high = (f"{v / check.predicted:.2g}" for v in (check.allowed_low, check.allowed_high))
    return [
        caution(
            "PT118",
            f"The readings do not determine the contact speed: {advice}. In a typical encounter, sensor curves "
            f"that fit the readings as well lead to {low} to {high} times the predicted contact speed.",
        )
    ]


def _few_flattened(prepared: Prepared) -> list[str]:
    """Return a warning if readings that were not repeated show that the output flattens or falls near the sensor."""
    first = prepared.window.distances[0] if prepared.window.distances else 0.0
    places, counts = np.unique(prepared.calibration.distances, return_counts=True)
    cut, single = places < first, (places < first) & (counts == 1)
    explained = is_explained_by_one_error(counts[cut])
    if prepared.window.saturation is not None or not (explained or (single.any() and prepared.flattens)):
        return []
    at = _list([format_quantity(float(place), "m") for place in places[single]], joint=" and ")
    if not explained:
        text = f": to use the readings at {at}, set each distance again and repeat its reading five times or more"
    elif single.sum() == 1:
        text = f", or the reading at {at} is wrong: set the distance again and repeat it five times or more"
    else:
        text = f", or one of the readings at {at} is wrong: set the distances again and repeat both five times or more"
    return [
        caution(
            "PT117",
            f"The output flattens or falls near the sensor{text}. Readings at distances below "
            f"{format_quantity(float(first), 'm')} are not used.",
        )
    ]


def _wrong_nearest(prepared: Prepared) -> list[str]:
    """Return a warning if the nearest reading is probably wrong.

    If its output is left out of the usable range, it changes no curve.
    """
    witness, used = prepared.witness, prepared.used
    if witness is None or not len(used.distance) or used.distance[0] > witness.ceilings.nearest:
        return []
    probability = witness.ceilings.nearest_is_wrong
    if probability <= _PROBABLY_WRONG:
        return []
    level, at = _level(prepared.calibration, used.output[0]), format_quantity(float(used.distance[0]), "m")
    return [
        caution(
            "PT117",
            f"The reading of {level} at the smallest distance {at} is probably wrong: repeat it five times or more. It "
            f"disagrees with the curves through the other readings (probability {100 * min(probability, 0.99):.0f} %).",
        )
    ]


def _weak_offset(prepared: Prepared) -> list[str]:
    """Return warnings if readings with no object would improve the fitted offset."""
    offset, calibration, weaknesses = prepared.offset, prepared.calibration, []
    if offset is None:
        return []
    lowest = float(average(calibration).output.min())
    if offset.value < 0 and offset.high < 0 and min([lowest, *calibration.no_object]) >= 0:
        weaknesses.append(
            caution(
                "PT103",
                f"The {offset.kind} offset of {_level(calibration, offset.value)} is negative, but no reading is "
                "negative: record the output with no object.",
            )
        )
    if offset.kind == "fitted" and prepared.flattens:
        weaknesses.append(
            caution(
                "PT103",
                "The offset was fitted, and the output flattens near the sensor; both change the curve in similar "
                "ways: record the output with no object.",
            )
        )
    return weaknesses


def _offset_contradictions(prepared: Prepared) -> list[str]:
    """Return warnings if the readings contradict the sensor offset."""
    offset, noise, reasons = prepared.offset, prepared.noise, []
    if offset is None or noise is None:
        return []
    curve = average(prepared.calibration)
    at = int(curve.output.argmin())
    lowest = float(curve.output[at])
    kind, level = offset.kind, f"{offset.value:.{offset.digits()}g} {prepared.calibration.unit}".rstrip()
    if offset.kind == "declared" and offset.value > lowest + 4 * noise.output / math.sqrt(float(curve.count[at])):
        reading = _level(prepared.calibration, lowest)
        reasons.append(
            caution(
                "PT103",
                f"The {kind} offset of {level} is larger than some readings, such as {reading}: record the output with "
                "no object. These readings contain no signal.",
            )
        )
    flattens = math.isfinite(prepared.steep_from) and kind == "measured"  # a ceiling also makes the output fall steeply
    if flattens or prepared.free is None or prepared.free.doubt(offset) <= _DOUBT[offset.kind]:
        return reasons
    free_offset = prepared.free.offset("fitted")
    fitted = f"{free_offset.value:.{free_offset.digits()}g} {prepared.calibration.unit}".rstrip()
    interval = free_offset.interval_in_words("")
    contradiction = (
        f"The readings at large distances level off at {fitted}, above the {kind} offset of {level}: record the output "
        f"with no object, or fit the offset. The fitted offset has the 95 % interval {interval}. The controller "
        "subtracts too little, so the virtual force becomes too weak."
        if free_offset.value > offset.value
        else f"The readings at large distances fall more steeply than any curve with the {kind} offset of {level}: "
        f"record the output with no object, or fit the offset. The readings agree with an offset of {fitted} (95 % "
        f"interval {interval}). The controller subtracts too much, so the virtual force becomes too strong at large "
        "distances."
    )
    return [*reasons, caution("PT103", contradiction)]


def _misfits(prepared: Prepared, fits: list[SensorFit]) -> list[str]:
    """Return a warning about readings far from the best model. Noise does not explain these deviations."""
    if prepared.noise is None or prepared.noise.misfit <= _LARGE_MISFIT:
        return []
    table = " The table model follows the readings." if any(f.model == "table" for f in fits) else ""
    return [
        caution(
            "PT109",
            f"Averaged readings deviate from the best model, {fits[0].model}, by {100 * prepared.noise.misfit:.0f} % "
            "of the signal, more than noise explains: check how the distances were set. This deviation is an RMS "
            f"value. The virtual force has about the same relative error.{table}",
        )
    ]
