"""Define the base class of sensor curves."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, fields, replace
from functools import cached_property, lru_cache, wraps
from typing import Any, ClassVar, Concatenate, ParamSpec, TypeVar, final

import numpy as np
from numpy.typing import ArrayLike

from pretouch._core.errors import InvalidInputError, OutOfRangeError
from pretouch._core.fields import Sign, check_types, quantity
from pretouch._core.files import plain
from pretouch._core.messages import short_repr
from pretouch._core.numbers import BoolArray, FloatArray, are_numbers, finite

from .family import Family, PlainFamily
from .sensitivity import CurveSensitivity, CurveSimilarity

P = ParamSpec("P")
R = TypeVar("R")


def parameter(
    symbol: str,
    unit: str,
    default: Any = None,
    *,
    sign: Sign = "any",
    example: str = "",
    of_output: str | None = None,
    largest: float = math.inf,
) -> Any:
    """Declare a dataclass field as a sensor curve parameter.

    Args:
        symbol: symbol of the parameter in the literature.
        unit: SI unit; empty for a pure number or a unit that depends on that of the output.
        default: default value; None if a value is required.
        sign: required sign: "any", "positive" or "negative".
        example: an example value in the syntax of a scenario file, for messages.
        of_output: unit of a scale, divided by the unit of the output; None for all other parameters.
        largest: largest allowed value.

    Returns:
        The field. A curve checks that the value of the field is one finite number with the required sign.
    """
    domain = (0.0 if sign == "positive" else -math.inf, 0.0 if sign == "negative" else largest)
    metadata: dict[str, Any] = {"symbol": symbol, "of_output": of_output, "domain": domain}
    return quantity(unit, MISSING if default is None else default, sign=sign, example=example, **metadata)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)  # subclasses define their own comparison
class SensorModel(ABC):
    """Base class of sensor curves.

    A curve computes the log output ln xi and its slope g for the virtual force L(2). The virtual force is F_p = D_p
    xi'/xi = D_p g(l) l', so force, motion and design need only these two functions. A new curve is a frozen dataclass
    that inherits from this class and defines `_log_output` and `_log_slope`. `check_sensor` then checks that it obeys
    the laws of sensor curves.

    Args:
        minimum_distance: smallest distance l at which the curve is valid [m].
        maximum_distance: largest distance l at which the curve is valid [m]; may be infinite.
    """

    minimum_distance: float = 0.0
    maximum_distance: float = math.inf

    name: ClassVar[str] = ""
    family: ClassVar[type[Family]] = PlainFamily
    """How the curve is fitted: by the general family, which needs `fit_start`, or by a specialized one."""

    def __post_init__(self) -> None:
        for f in self._declared():
            value = _number(getattr(self, f.name), f.name, f.metadata["unit"])
            _check_domain(value, f.name, f.metadata)
            object.__setattr__(self, f.name, value)
        low = _number(self.minimum_distance, "minimum_distance", "m")
        high = _limit(self.maximum_distance, "maximum_distance")
        object.__setattr__(self, "minimum_distance", low)
        object.__setattr__(self, "maximum_distance", high)
        check_types(self)
        if not low < high:
            raise InvalidInputError(
                f"maximum_distance: found {high:g} m, expected more than the minimum_distance of {low:g} m",
                value=high,
                limit=low,
            )

    @abstractmethod
    def _log_output(self, distance: FloatArray) -> FloatArray:
        """Return the log output ln xi at valid distances. The caller has checked the distances."""

    @abstractmethod
    def _log_slope(self, distance: FloatArray) -> FloatArray:
        """Return g = d ln xi / dl [1/m] at distances that the caller has checked."""

    @property
    def valid_range(self) -> tuple[float, float]:
        """The smallest and largest valid distance of the curve [m]."""
        return self.minimum_distance, self.maximum_distance

    @property
    def knots(self) -> tuple[float, ...]:
        """The distances where a derivative of the log output jumps [m].

        The derivative is with respect to the distance.
        """
        low, high = self.valid_range
        return tuple(sorted(k for k in self._knots() if low < k < high))

    def _knots(self) -> Iterable[float]:
        return ()

    @property
    def constant_log_slope(self) -> float | None:
        """The constant slope g of the sensor curve [1/m].

        It is None if the slope depends on the distance.
        """
        return None

    @classmethod
    def _declared(cls) -> list[Field[Any]]:
        """Return the dataclass fields of the curve parameters. The scale comes first."""
        return [f for f in fields(cls) if "unit" in f.metadata]

    @property
    def parameters(self) -> dict[str, float]:
        """The parameters of the sensor curve by name, in SI units."""
        return {f.name: getattr(self, f.name) for f in self._declared()}

    @property
    def bare(self) -> tuple[SensorModel, float]:
        """The sensor curve without recess, and the recess [m].

        The recess is how far the sensor is behind the contact surface.
        """
        return self, 0.0

    @property
    def parameter_units(self) -> dict[str, str]:
        """The SI units of the sensor curve's parameters.

        They are given by parameter name. The unit of a dimensionless parameter is an empty text.
        """
        return {f.name: f.metadata["unit"] for f in self._declared()}

    def with_parameters(self, values: Mapping[str, float]) -> SensorModel:
        """Return a copy of the sensor curve with new parameters.

        The values are in SI units. Other parameters do not change.
        """
        return replace(self, **values)

    @classmethod
    def fit_start(cls, slope: float, curvature: float, middle: float) -> Mapping[str, float] | None:  # noqa: ARG003
        """Return initial parameters for fitting this sensor curve.

        The scale factor is not included.

        Args:
            slope: g in the middle of the window [1/m].
            curvature: dg/dl there [1/m^2].
            middle: the distance there [m].

        Returns:
            The parameters by name, in SI; None for a curve that is not fitted.
        """
        return None

    def _similarity(
        self,
        values: Mapping[str, FloatArray],  # noqa: ARG002
        recess: FloatArray,  # noqa: ARG002
        distance: Any,  # noqa: ARG002
    ) -> CurveSimilarity | None:
        """Return factors that convert similar sensor curves to one reference curve.

        They scale length and gain. The result is None if no such factors exist.

        Args:
            values: arrays of the parameters that differ.
            recess: the recess of each curve [m].
            distance: the distances at which encounters start [m].
        """
        return None

    def to_dict(self) -> dict[str, Any]:
        """Return the sensor curve as a dictionary for JSON, in SI units."""
        content = {"model": self.name, "parameters": self.parameters, "valid_range": self.valid_range}
        return dict(plain(content))

    def _sensitivity_to(self, name: str) -> CurveSensitivity | None:  # noqa: ARG002 - for subclasses
        """Return the exact derivative of the sensor curve by a parameter; None if there is none."""
        return None

    @final
    def log_output(self, distance: ArrayLike) -> Any:
        """Return the log output ln xi(l) at valid distances [m].

        The result is a float for a single distance.
        """
        return self._like(distance, self._log_output(self._checked(distance)))

    @final
    def log_slope(self, distance: ArrayLike) -> Any:
        """Return the slope g(l) [1/m] at valid distances [m].

        The slope is g(l) = d ln xi / dl. The result is a float for a single distance.
        """
        return self._like(distance, self._log_slope(self._checked(distance)))

    @final
    def output(self, distance: ArrayLike) -> Any:
        """Return the sensor output xi(l) at valid distances [m].

        The output is in the unit of the calibration.
        """
        return self._like(distance, np.exp(self._log_output(self._checked(distance))))

    @final
    def contains(self, distance: ArrayLike) -> BoolArray:
        """Return True where the sensor curve is valid.

        The distances l are in m.
        """
        low, high = self.valid_range
        values = _distances(distance)
        return np.asarray((values >= low) & (values <= high))

    def _checked(self, distance: ArrayLike) -> FloatArray:
        values = _distances(distance)
        inside = self.contains(values)
        if not inside.all():
            low, high = self.valid_range
            outside = float(np.atleast_1d(values)[~np.atleast_1d(inside)][0])
            raise OutOfRangeError(
                f"distance: found {outside:g} m, but the {self.name or type(self).__name__} curve is valid only "
                f"from {low:g} m to {high:g} m",
                value=outside,
                limit=(low, high),
            )
        return values

    def _like(self, distance: ArrayLike, values: ArrayLike) -> Any:
        result = np.asarray(values, dtype=np.float64)
        if result.shape != np.shape(distance):
            raise InvalidInputError(
                f"sensor: the {self.name or type(self).__name__} curve returned an array of shape {result.shape} "
                f"for distances of shape {np.shape(distance)}, expected the same shape"
            )
        return float(result) if result.ndim == 0 else result


def _distances(distance: ArrayLike) -> FloatArray:
    """Convert distances [m] to a float array. Values that are not numbers are an error."""
    values = np.asarray(distance)
    if values.dtype.kind == "f" or are_numbers(distance):
        return np.asarray(values, dtype=np.float64)
    raise InvalidInputError(
        f"distance: found {short_repr(distance)}, expected a number or an array of numbers in meters", value=distance
    )


def _check_domain(value: float, name: str, metadata: Mapping[str, Any]) -> None:
    """Check the sign and magnitude of a curve parameter."""
    sign, (_, largest) = metadata["sign"], metadata["domain"]
    if (sign != "positive" or value > 0) and (sign != "negative" or value < 0) and value <= largest:
        return
    text = f"{value:g} {metadata['unit']}".strip()
    limits = (0.0, largest) if sign == "positive" else (-math.inf, 0.0) if sign == "negative" else None
    rule = f"must lie in (0, {largest:g}]" if sign == "positive" and math.isfinite(largest) else f"must be {sign}"
    raise InvalidInputError(f"{name}: found {text}, which {rule}", value=value, limit=limits)


def _number(value: Any, name: str, unit: str) -> float:
    """Check that a value is a single finite number. Return the number as a float."""
    number = finite(value, name, unit)
    if not isinstance(number, float):
        raise InvalidInputError(f"{name}: found an array of shape {np.shape(number)}, expected a single number")
    return number


def _limit(value: Any, name: str) -> float:
    """Check that a limit of the distance is one number, which may be infinite."""
    return float(value) if isinstance(value, float) and math.isinf(value) else _number(value, name, "m")


def cache_by_curve(
    size: int,
) -> Callable[[Callable[Concatenate[SensorModel, P], R]], Callable[Concatenate[SensorModel, P], R]]:
    """Return a decorator that caches a function whose first argument is a sensor curve.

    At most `size` results are cached. Equal curves share their results. Curves are compared by their fields only, so
    results of a curve with further attributes are not cached.
    """

    def decorate(function: Callable[Concatenate[SensorModel, P], R]) -> Callable[Concatenate[SensorModel, P], R]:
        cached = lru_cache(maxsize=size)(function)

        @wraps(function)
        def call(sensor: SensorModel, /, *args: P.args, **kwargs: P.kwargs) -> R:
            return (cached if _has_only_fields(sensor) else function)(sensor, *args, **kwargs)  # type: ignore[arg-type]

        return call

    return decorate


def _has_only_fields(sensor: SensorModel) -> bool:
    """Return True if a sensor curve has only dataclass fields. Cached properties may exist, but no other attributes."""
    attributes = getattr(sensor, "__dict__", None)
    if attributes:
        others = attributes.keys() - {f.name for f in fields(sensor)}
        if any(not isinstance(getattr(type(sensor), name, None), cached_property) for name in others):
            return False
    inner = getattr(sensor, "sensor", None)
    return _has_only_fields(inner) if isinstance(inner, SensorModel) else True


def is_built_in(sensor: SensorModel) -> bool:
    """Return True if a sensor curve is part of pretouch.

    A curve with user-defined functions does not count.
    """
    cls: Any = type(sensor)
    cached: bool | None = cls.__dict__.get("_built_in")
    if cached is not None:
        return cached
    curve = innermost(sensor)
    result = type(curve).__module__.startswith("pretouch.") and not hasattr(curve, "log_output_function")
    if result and curve is sensor and not hasattr(cls, "sensor"):
        cls._built_in = True
    return result


def innermost(sensor: SensorModel) -> SensorModel:
    """Return the sensor curve inside a recessed sensor.

    Any other curve is returned unchanged.
    """
    while isinstance(inner := getattr(sensor, "sensor", None), SensorModel):
        sensor = inner
    return sensor
