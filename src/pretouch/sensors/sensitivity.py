"""How a parameter of a sensor curve changes the curve, and which curves are one in other units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray, chebyshev_basis, chebyshev_extremes, chebyshev_sum


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurveSimilarity:
    """How many curves of one kind are one: with X = s x the equation of motion keeps its form if the force does.

    The lengths of each are multiplied by s, its `length`, and its gain by `gain`; of the parameters that matter, the
    derivatives of the logarithms of both factors by each.
    """

    curve: Any
    length: Any
    gain: Any
    parameters: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)


SlopeSensitivity: TypeAlias = Callable[[FloatArray], FloatArray]

_WINDOW: Final = 0.05  # of a parameter, to either side: where a curve is sampled for a derivative by it
_NODES: Final = chebyshev_extremes(10)
_ROUNDING: Final = 1e-15  # of the slopes: what is left of those that are alike


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurveSensitivity:
    """The derivative of ln xi by a parameter, up to a constant: output ln xi + shift g + stretch l g.

    These three have a meaning of their own: a larger gain, a sensor farther behind the surface, another unit of length.
    So whatever follows from them follows for the parameter; the shift is in m. Where a change is none of these, or is
    one only with a loss of digits, as where a motion starts nearer than `nearest` [m], the slope says everything: the
    derivative of g by the parameter, as a function of the distance [m].
    """

    output: float = 0.0
    shift: float = 0.0
    stretch: float = 0.0
    slope: SlopeSensitivity | None = None
    nearest: float = 0.0


def curve_sensitivity(sensor: Any, name: str) -> CurveSensitivity:
    """Return how a parameter, a key of the sensor's `parameter_units`, changes a curve; any other key is refused."""
    # Where the class of the curve does not say it, dg/d(parameter) is that of the polynomial through eleven curves with
    # the parameter within 5 % of its value, or on one side of it where the other makes no sense. It is good to some
    # 1e-11 of itself where g is computed to rounding.
    if name not in sensor.parameter_units:
        raise InvalidInputError(
            f"parameter: found {name!r}, expected one of {', '.join(sensor.parameter_units) or 'none at all'}"
        )
    known = sensor._sensitivity_to(name) if _describes_own_curve(type(sensor)) else None
    return known if known is not None else CurveSensitivity(slope=_by_differences(sensor, name))


def _describes_own_curve(cls: type) -> bool:
    """Tell whether what a class says of changes is said of its own curve, not of one that it inherits from."""
    first = {name: next(c for c in cls.__mro__ if name in vars(c)) for name in ("_sensitivity_to", "_log_slope")}
    return issubclass(first["_sensitivity_to"], first["_log_slope"])


def _by_differences(sensor: Any, name: str) -> SlopeSensitivity:
    """Return dg/d(parameter) from curves with other values of it."""
    value = float(getattr(sensor, name))
    half = _WINDOW * abs(value) or 1e-3
    error: InvalidInputError | None = None
    for middle in (value, value - half, value + half):
        try:
            curves = [replace(sensor, **{name: float(v)}) for v in middle + half * _NODES]
        except InvalidInputError as found:
            error = found
            continue
        # what the values at Chebyshev's extreme points add to the derivative of their polynomial
        weights = chebyshev_sum(chebyshev_basis(tuple(_NODES)).to_slope, (value - middle) / half) / half

        def slope(distance: FloatArray, curves: Any = curves, weights: FloatArray = weights) -> FloatArray:
            slopes = np.array([c._log_slope(distance) for c in curves])
            change = np.tensordot(weights, slopes, axes=1)
            rounding = np.tensordot(np.abs(weights), np.abs(slopes), axes=1)
            # a scale changes no slope: what its differences leave is rounding, which no polynomial meets
            return np.where(np.abs(change) <= _ROUNDING * rounding, 0.0, change)

        return slope
    raise InvalidInputError(f"{name}: found {value:g}, beside which the curve has no derivative: {error}")
