"""What a calibration leaves open of its curve, as a distribution of the parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch.motion.inputs import sensor_with

from .correlated import CorrelatedNormal

if TYPE_CHECKING:
    from pretouch.calibration import SensorFit

__all__ = ["parameter_distribution"]

_DEVIATIONS: Final = 4.0  # beyond which one sample in 16,000 lies


def parameter_distribution(fit: SensorFit) -> CorrelatedNormal:
    """Return how the parameters of a fitted curve may lie: normal, with the covariance of the fit.

    The scale of the output is left out: it cancels from the virtual force. Parameters of a curve are strongly
    correlated (a larger exponent with a larger offset gives nearly the same curve), so that to vary each for itself
    would promise far too little.

    Args:
        fit: one model fitted to one calibration, with the share of the no-object offset in its covariance.

    Returns:
        The distribution of `sensor.NAME` for each parameter; under a free name, a value of an uncertainty.

    Raises:
        InvalidInputError: the readings do not bound a parameter, the curve has none, or four standard errors lead to
            values that no such curve has.

    Examples:
        >>> from pretouch.calibration import Calibration, fit_sensor
        >>> distance = np.linspace(0.0, 0.08, 33)
        >>> noise = 1e-3 * np.sin(1e4 * distance)
        >>> measured = Calibration(distances=distance, outputs=np.exp(-61.0 * distance) + noise, unit="V")
        >>> known = parameter_distribution(fit_sensor(measured, "exponential-1", offset="zero"))
        >>> known.names, round(known.mean[0])
        (('sensor.rate',), -61)
    """
    names = [name for name in fit.parameters if name != "scale"]
    if not names:
        raise InvalidInputError(
            f"fit: found a {fit.model}, which has no parameters whose covariance could be known; fit a curve with "
            "parameters, such as inverse-power"
        )
    chosen = [list(fit.parameters).index(name) for name in names]
    covariance = fit.covariance[np.ix_(chosen, chosen)]
    open_ended = [n for n in names if not np.isfinite(fit.parameters[n].standard_error)]
    if open_ended or not np.isfinite(covariance).all():
        why = f" {' '.join(fit.identifiable)}" if fit.identifiable else ""
        raise InvalidInputError(
            f"fit: the readings do not bound {' and '.join(open_ended or names)}, so that there is no covariance to "
            f"draw from.{why} Fit a curve with fewer parameters, such as exponential-1, or state what is known of each"
        )
    mean = np.array([fit.parameters[name].value for name in names])
    _check_tails(fit, names, mean, covariance)
    return CorrelatedNormal(
        names=tuple(f"sensor.{name}" for name in names),
        mean=tuple(mean.tolist()),
        covariance=tuple(map(tuple, covariance.tolist())),
    )


def _check_tails(fit: SensorFit, names: list[str], mean: np.ndarray, covariance: np.ndarray) -> None:
    """Refuse parameters whose tails leave what a curve can be, the others where they then likeliest are."""
    for i, name in enumerate(names):
        error = float(np.sqrt(max(covariance[i, i], 0.0)))
        if error == 0:
            continue
        for side in (-_DEVIATIONS, _DEVIATIONS):
            values = dict(zip(names, (mean + side * covariance[:, i] / error).tolist(), strict=True))
            try:
                sensor_with(fit.sensor, values)
            except InvalidInputError as impossible:
                raise InvalidInputError(
                    f"fit: {name} is known to {mean[i]:.4g} with a standard error of {error:.2g} only, and a normal "
                    f"distribution that wide holds impossible curves ({impossible}); calibrate with more readings, or "
                    "state what is known of each parameter"
                ) from None
