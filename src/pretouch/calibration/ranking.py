"""Rank sensor models by the information criterion AICc.

Also judge whether the sensor is usable.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from pretouch._core.arguments import check_arguments
from pretouch._core.units import format_quantity
from pretouch._core.warning_codes import split_code

from .data import Calibration
from .doubtful_distances import distance_reservations, doubtful_distances, without_distance
from .model_fit import attempt_fit, check_models, model_names
from .preparation import OffsetChoice, Prepared, prepare
from .result import CalibrationReport, SensorFit
from .slope_uncertainty import estimate_slope
from .verdict_reasons import (
    FEW_POINTS,
    contact_reservations,
    find_reservations,
    find_weaknesses,
    ignored_readings,
    summary,
)

if TYPE_CHECKING:
    from .contact_check import WitnessCheck

_DOUBTFUL: Final = frozenset({"PT103", "PT108", "PT109"})  # the readings contradict the offset or the curve


@check_arguments
def fit(
    calibration: Calibration,
    models: tuple[str, ...] | None = None,
    *,
    offset: OffsetChoice = "auto",
    saturation: float | str | None = "auto",
    near_field_peak: float | str | None = "auto",
    floor_sigmas: float = 3.0,
) -> CalibrationReport:
    """Fit all sensor models to a calibration and rank them.

    The models are ranked by AICc. The report also judges whether the sensor is usable. An invalid option raises
    `InvalidInputError`; a sensor without signal does not.

    Args:
        calibration: the readings.
        models: names of the models; all models by default.
        offset: as in `fit_sensor`.
        saturation: as in `fit_sensor`.
        near_field_peak: as in `fit_sensor`.
        floor_sigmas: as in `fit_sensor`.

    Returns:
        The report; without a usable signal, it has no fits and gives the reason.

    Examples:
        >>> import numpy as np
        >>> distance = np.repeat(np.arange(12) * 0.005, 3)
        >>> outputs = 0.3 + 2.0 * np.exp(-60 * distance) + np.tile([-0.002, 0.0, 0.002], 12)
        >>> report = fit(Calibration(distances=distance, outputs=outputs, no_object=[0.298, 0.3, 0.302]))
        >>> report.verdict, report.best.model
        ('usable', 'exponential-1')
    """
    models = model_names() if models is None else tuple(dict.fromkeys(models))
    check_models(models)
    prepared = prepare(calibration, offset, saturation, near_field_peak, floor_sigmas, models=models)
    found_distances = () if prepared.no_signal else doubtful_distances(prepared)
    wrong = next((each for each in found_distances if each.is_wrong), None)
    kept = calibration if wrong is None else without_distance(calibration, wrong.distance)
    if wrong is not None:
        prepared = prepare(kept, offset, saturation, near_field_peak, floor_sigmas, models=models)
    if math.isfinite(prepared.steep_from) and not _is_determined_by_table(prepared, models):
        prepared = prepare(kept, offset, saturation, near_field_peak, floor_sigmas, models=models, uses_flattened=False)
    fits: list[SensorFit] = []
    not_fitted: dict[str, str] = {}
    if not prepared.no_signal:
        attempts = {model: attempt_fit(model, prepared) for model in models}
        not_fitted = {model: reason for model, reason in attempts.items() if isinstance(reason, str)}
        fits = _ranked([fit for fit in attempts.values() if isinstance(fit, SensorFit)])
    slope = estimate_slope(prepared)
    if math.isfinite(prepared.steep_from):  # no other model follows an output that flattens
        fits = sorted(fits, key=lambda fit: fit.model != "table")
    reasons, notes = prepared.no_signal, tuple[str, ...]()
    contradictions = doubtful = (
        *distance_reservations(calibration),
        *(each.text for each in found_distances),
    )
    if not prepared.no_signal:
        check = _check(prepared, fits)
        weaknesses = tuple(
            find_weaknesses(prepared, fits, slope, reading_count=len(calibration.outputs) + len(calibration.no_object))
        )
        found = find_reservations(prepared, fits, slope)
        contradictions += tuple(text for text in found if split_code(text)[0] in _DOUBTFUL)
        reasons = (*contact_reservations(prepared, check), *found)
        determined = check is not None and check.is_determined and len(prepared.used.distance) >= FEW_POINTS
        if determined and not doubtful:  # with wrong distances, the check means nothing
            notes = weaknesses
        else:
            reasons = (*reasons, *weaknesses)
    reasons = (*doubtful, *reasons) if not prepared.no_signal else (*reasons, *doubtful)
    usable = "usable with reservations" if reasons else "usable"
    return CalibrationReport(
        calibration=prepared.calibration,
        fits=tuple(fits),
        window=prepared.window,
        offset=prepared.offset,
        noise=prepared.noise,
        verdict=usable if not prepared.no_signal else "too few distances" if prepared.too_few else "no usable signal",
        reasons=reasons or (summary(prepared, fits),),
        contradictions=contradictions,
        notes=notes,
        not_fitted=not_fitted,
        slope=slope,
        left_out=(*ignored_readings(prepared), *(() if wrong is None else (_left_out(calibration, wrong.distance),))),
        curves=prepared.witness,
    )


def _left_out(calibration: Calibration, distance: float) -> str:
    """Say which readings at a doubtful distance are not used."""
    count = int((calibration.distances == distance).sum())
    return (
        f"{count} reading{'s' if count != 1 else ''} at {format_quantity(distance, 'm')}, far beyond all others: the "
        "output disagrees with every curve through the other readings (PT114)."
    )


def _is_determined_by_table(prepared: Prepared, models: tuple[str, ...]) -> bool:
    """Return True if a table through the readings that flatten determines the contact speed."""
    table = attempt_fit("table", prepared) if "table" in models and not prepared.no_signal else ""
    check = None if isinstance(table, str) else _check(prepared, [table])
    return check is not None and check.is_determined


def _check(prepared: Prepared, fits: list[SensorFit]) -> WitnessCheck | None:
    """Test the best fit with a typical encounter on all curves that the readings allow."""
    if not fits or prepared.witness is None or prepared.offset is None:
        return None
    from .contact_check import reference_check  # noqa: PLC0415 - the compiled kernels, only when needed

    low, high = fits[0].sensor.valid_range
    return reference_check(prepared.witness, prepared.offset.value, fits[0].sensor, nearest=low, farthest=high)


def _ranked(fits: list[SensorFit]) -> list[SensorFit]:
    """Return the fitted models from best to worst.

    The order is that of AICc. With so few distances that a model has no AICc, it is that of the cross-validation error,
    which every model has. Tables come last, because they follow the noise.
    """
    comparable = all(fit.aicc is not None for fit in fits if fit.model != "table")

    def key(fit: SensorFit) -> tuple[bool, float, float]:
        error = math.inf if fit.cross_validation is None else fit.cross_validation
        return fit.model == "table", fit.aicc if comparable and fit.aicc is not None else 0.0, error

    return sorted(fits, key=key)
