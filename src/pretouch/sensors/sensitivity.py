"""Describe how a sensor curve changes with its parameters.

Some changes only scale the curve.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, chebyshev_basis, chebyshev_extremes, chebyshev_sum


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurveSimilarity:
    """Scale factors that convert sensor curves to one reference curve.

    All curves are of one class. With scaled lengths X = s x, the equation of motion
    keeps its form if the force does. Lengths are multiplied by `length` = s and the gain by `gain`.

    Args:
        curve: the reference curve.
        length: s of each curve.
        gain: factor of the gain of each curve.
        parameters: derivatives of ln(length) and ln(gain) with respect to each parameter that changes them.
    """

    curve: Any
    length: Any
    gain: Any
    parameters: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)


SlopeSensitivity: TypeAlias = Callable[[FloatArray], FloatArray]

_WINDOW: Final = 0.05  # relative half width of the parameter interval that is sampled for a derivative
_NODES: Final = chebyshev_extremes(10)
_ROUNDING: Final = 1e-15  # relative rounding error of slopes; smaller differences count as zero


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurveSensitivity:
    """Sensitivity of the log sensor output to one curve parameter.

    The sensitivity is the derivative of ln xi with respect to the parameter. Up to a constant, the derivative equals
    output * ln xi + shift * g + stretch * l * g.

    The three terms act like a change of the gain, of the recess, and of the unit of length. Derivatives by these
    quantities therefore yield the derivative by the parameter. If the three terms do not describe the change, or only
    with a loss of digits, `slope` describes it.

    Args:
        output: factor of ln xi.
        shift: factor of g [m].
        stretch: factor of l g.
        slope: dg/d(parameter) as a function of the distance [m]; None if the three terms suffice.
        nearest: starting distance [m] below which the three terms lose digits, so that `slope` is used instead.
    """

    output: float = 0.0
    shift: float = 0.0
    stretch: float = 0.0
    slope: SlopeSensitivity | None = None
    nearest: float = 0.0


def curve_sensitivity(sensor: Any, name: str) -> CurveSensitivity:
    """Differentiate a sensor curve with respect to one parameter.

    Returns:
        The exact derivative if the class of the curve defines it. Otherwise dg/d(parameter) is computed from the
        polynomial through eleven curves with the parameter within 5 % of its value. If values on one side are invalid,
        the other side is used. The relative error is about 1e-11 if g is computed to rounding.

    Raises:
        InvalidInputError: the curve has no such parameter.
    """
    if name not in sensor.parameter_units:
        raise InvalidInputError(
            f"parameter: found {name!r}, expected one of {', '.join(sensor.parameter_units) or 'none at all'}",
            value=name,
            limit=tuple(sensor.parameter_units),
        )
    exact = sensor._sensitivity_to(name) if _describes_own_curve(type(sensor)) else None
    return exact if exact is not None else CurveSensitivity(slope=_by_differences(sensor, name))


def _describes_own_curve(cls: type) -> bool:
    """Return True if a curve class defines its own parameter derivatives. Inherited derivatives do not count.

    A subclass that overrides `_log_slope` but not `_sensitivity_to` has a curve that the latter does not describe.
    """
    first = {name: next(c for c in cls.__mro__ if name in vars(c)) for name in ("_sensitivity_to", "_log_slope")}
    return issubclass(first["_sensitivity_to"], first["_log_slope"])


def _by_differences(sensor: Any, name: str) -> SlopeSensitivity:
    """Differentiate the slope of a sensor curve by a parameter numerically."""
    value = float(getattr(sensor, name))
    half = _WINDOW * abs(value) or 1e-3
    error: InvalidInputError | None = None
    for middle in (value, value - half, value + half):
        try:
            curves = [replace(sensor, **{name: float(v)}) for v in middle + half * _NODES]
        except InvalidInputError as invalid:
            error = invalid
            continue
        # weights of the values at the Chebyshev extrema in the derivative of their polynomial
        weights = chebyshev_sum(chebyshev_basis(tuple(_NODES)).to_slope, (value - middle) / half) / half

        def slope(distance: FloatArray, curves: Any = curves, weights: FloatArray = weights) -> FloatArray:
            slopes = np.array([c._log_slope(distance) for c in curves])
            change = np.tensordot(weights, slopes, axes=1)
            rounding = np.tensordot(np.abs(weights), np.abs(slopes), axes=1)
            # A scale does not change the slope. Its differences are only rounding, which no polynomial fits.
            return np.where(np.abs(change) <= _ROUNDING * rounding, 0.0, change)

        return slope
    raise InvalidInputError(
        f"{name}: the sensor curve cannot be differentiated with respect to this parameter. Values of the parameter "
        f"near {value:g} are invalid, with the error: {error}"
    )
