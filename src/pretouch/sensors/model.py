"""What a proximity sensor is to pretouch: ln xi(l), its slope g(l), and the distances at which they hold."""

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

from .change import Alike, CurveChange
from .family import Family, PlainFamily

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
    """Declare a dataclass field that is a parameter of the curve: all that fits, files and messages ask of it.

    Args:
        symbol: how the literature writes it.
        unit: its SI unit; the empty text for a pure number, or one that follows the output's.
        default: its value where none is given; None where one must be.
        sign: "any", "positive" or "negative": checked.
        example: a value as a scenario file has it, for messages.
        of_output: for a scale: its unit over that of the output; None for all others.
        largest: what it may be at most.

    Returns:
        The field; its value is checked to be one finite number of that sign.
    """
    domain = (0.0 if sign == "positive" else -math.inf, 0.0 if sign == "negative" else largest)
    told: dict[str, Any] = {"symbol": symbol, "of_output": of_output, "domain": domain}
    return quantity(unit, MISSING if default is None else default, sign=sign, example=example, **told)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)  # a subclass compares all of its own fields, or itself
class SensorModel(ABC):
    """A sensor curve: ln xi(l) and g(l) = d ln xi / dl on a valid range, L(2).

    The virtual force is F_p = D_p xi'/xi = D_p g(l) l', so these two functions are all that force, motion and
    design ever ask of a sensor. A new curve is a frozen dataclass that inherits from this one and defines
    `_log_output` and `_log_slope`; `check_sensor` then tells whether it obeys the laws.

    Args:
        minimum_distance: smallest distance l at which the curve holds [m].
        maximum_distance: largest distance l at which the curve holds [m]; may be infinite.
    """

    minimum_distance: float = 0.0
    maximum_distance: float = math.inf

    name: ClassVar[str] = ""
    family: ClassVar[type[Family]] = PlainFamily
    """How it is fitted: by the general way, which needs `fit_start`, or by one of its own."""

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
                f"maximum_distance: found {high:g} m, which must exceed minimum_distance ({low:g} m)"
            )

    @abstractmethod
    def _log_output(self, distance: FloatArray) -> FloatArray:
        """Return ln xi at distances that are known to be valid."""

    @abstractmethod
    def _log_slope(self, distance: FloatArray) -> FloatArray:
        """Return g = d ln xi / dl [1/m] at distances that are known to be valid."""

    @property
    def valid_range(self) -> tuple[float, float]:
        """The distances [l_min, l_max] in m between which the curve holds."""
        return self.minimum_distance, self.maximum_distance

    @property
    def knots(self) -> tuple[float, ...]:
        """Distances inside the valid range at which a higher derivative of ln xi jumps, in m."""
        low, high = self.valid_range
        return tuple(sorted(k for k in self._knots() if low < k < high))

    def _knots(self) -> Iterable[float]:
        return ()

    @property
    def constant_log_slope(self) -> float | None:
        """The slope g [1/m] where it is the same at every distance, else None."""
        return None

    @classmethod
    def _declared(cls) -> list[Field[Any]]:
        """Return the fields that are parameters of the curve, the scale first, with what `parameter` told of them."""
        return [f for f in fields(cls) if "unit" in f.metadata]

    @property
    def parameters(self) -> dict[str, float]:
        """The parameters of the curve by name, in SI."""
        return {f.name: getattr(self, f.name) for f in self._declared()}

    @property
    def bare(self) -> tuple[SensorModel, float]:
        """The curve over the distance from the sensor's own zero, and how far that lies behind the surface [m]."""
        return self, 0.0

    @property
    def parameter_units(self) -> dict[str, str]:
        """The SI unit of each parameter by its name; the empty text for pure numbers."""
        return {f.name: f.metadata["unit"] for f in self._declared()}

    def with_parameters(self, values: Mapping[str, float]) -> SensorModel:
        """Return the curve with other values of parameters, in SI."""
        return replace(self, **values)

    @classmethod
    def fit_start(cls, slope: float, curvature: float, middle: float) -> Mapping[str, float] | None:  # noqa: ARG003
        """Return parameters, but for the scale, of a curve near what readings say: where a fit starts.

        Args:
            slope: g in the middle of the window [1/m].
            curvature: dg/dl there [1/m^2].
            middle: the distance there [m].

        Returns:
            The parameters by name, in SI; None for a curve that is not fitted.
        """
        return None

    def _alike(self, values: Mapping[str, FloatArray], recess: FloatArray, distance: Any) -> Alike | None:  # noqa: ARG002
        """Return how curves with other parameters and recesses [m] are one, from the distances [m] where they start."""
        return None

    def to_dict(self) -> dict[str, Any]:
        """Return the curve as one JSON object, in SI."""
        told = {"model": self.name, "parameters": self.parameters, "valid_range": self.valid_range}
        return dict(plain(told))

    def _change_by(self, name: str) -> CurveChange | None:  # noqa: ARG002 - for subclasses
        """Return how a parameter changes ln xi, where that is known; None: it is found by differences."""
        return None

    @final
    def log_output(self, distance: ArrayLike) -> Any:
        """Evaluate ln xi(l) at distances l [m] of any shape inside the valid range; a float for a scalar."""
        return self._like(distance, self._log_output(self._checked(distance)))

    @final
    def log_slope(self, distance: ArrayLike) -> Any:
        """Evaluate g(l) = d ln xi / dl [1/m] at distances l [m] of any shape inside the valid range, likewise."""
        return self._like(distance, self._log_slope(self._checked(distance)))

    @final
    def output(self, distance: ArrayLike) -> Any:
        """Evaluate the output xi(l), in the calibration's unit, at distances [m] inside the valid range, likewise."""
        return self._like(distance, np.exp(self._log_output(self._checked(distance))))

    @final
    def contains(self, distance: ArrayLike) -> BoolArray:
        """Tell which distances l [m], of any shape, lie inside the valid range."""
        low, high = self.valid_range
        values = _distances(distance)
        return np.asarray((values >= low) & (values <= high))

    def _checked(self, distance: ArrayLike) -> FloatArray:
        values = _distances(distance)
        inside = self.contains(values)
        if not inside.all():
            low, high = self.valid_range
            culprit = float(np.atleast_1d(values)[~np.atleast_1d(inside)][0])
            raise OutOfRangeError(
                f"distance: found {culprit:g} m, where the {self.name or type(self).__name__} sensor says nothing; "
                f"it is valid from {low:g} m to {high:g} m"
            )
        return values

    def _like(self, distance: ArrayLike, values: ArrayLike) -> Any:
        result = np.asarray(values, dtype=np.float64)
        if result.shape != np.shape(distance):
            raise InvalidInputError(
                f"sensor: the {self.name or type(self).__name__} curve gave the shape {result.shape} for distances of "
                f"the shape {np.shape(distance)}, expected the same"
            )
        return float(result) if result.ndim == 0 else result


def _distances(distance: ArrayLike) -> FloatArray:
    """Return distances [m] as an array of floats; refuse texts, truth values and whatever else is no number."""
    values = np.asarray(distance)
    if values.dtype.kind == "f" or are_numbers(distance):
        return np.asarray(values, dtype=np.float64)
    raise InvalidInputError(f"distance: found {short_repr(distance)}, expected a number or an array of numbers in m")


def _check_domain(value: float, name: str, metadata: Mapping[str, Any]) -> None:
    """Check that a parameter has the sign that its declaration says, and is not too large."""
    sign, (_, most) = metadata["sign"], metadata["domain"]
    if (sign != "positive" or value > 0) and (sign != "negative" or value < 0) and value <= most:
        return
    found = f"{value:g} {metadata['unit']}".strip()
    must = f"must lie in (0, {most:g}]" if sign == "positive" and math.isfinite(most) else f"must be {sign}"
    raise InvalidInputError(f"{name}: found {found}, which {must}")


def _number(value: Any, name: str, unit: str) -> float:
    """Check that a value is one finite number."""
    number = finite(value, name, unit)
    if not isinstance(number, float):
        raise InvalidInputError(f"{name}: found an array of shape {np.shape(number)}, expected one number")
    return number


def _limit(value: Any, name: str) -> float:
    """Check that a value is one number [m], which may be infinite."""
    return float(value) if isinstance(value, float) and math.isinf(value) else _number(value, name, "m")


def kept_by_curve(
    most: int,
) -> Callable[[Callable[Concatenate[SensorModel, P], R]], Callable[Concatenate[SensorModel, P], R]]:
    """Keep `most` results of a function of a curve and of numbers; what was asked before changes nothing of them."""
    # Equal curves share their results. Curves compare their fields: one that holds anything else, which a comparison
    # does not see, has its results computed anew.

    def keeping(function: Callable[Concatenate[SensorModel, P], R]) -> Callable[Concatenate[SensorModel, P], R]:
        kept = lru_cache(maxsize=most)(function)

        @wraps(function)
        def found(sensor: SensorModel, /, *args: P.args, **kwargs: P.kwargs) -> R:
            return (kept if _is_what_it_compares(sensor) else function)(sensor, *args, **kwargs)  # type: ignore[arg-type]

        return found

    return keeping


def _is_what_it_compares(sensor: SensorModel) -> bool:
    """Tell whether a curve, and each that it is made of, holds its fields and what it has computed from them only."""
    held = getattr(sensor, "__dict__", None)
    if held:
        others = held.keys() - {f.name for f in fields(sensor)}
        if any(not isinstance(getattr(type(sensor), name, None), cached_property) for name in others):
            return False
    inner = getattr(sensor, "sensor", None)
    return _is_what_it_compares(inner) if isinstance(inner, SensorModel) else True


def is_built_in(sensor: SensorModel) -> bool:
    """Tell whether a curve is one of pretouch, with parameters in the place of a user's functions."""
    cls: Any = type(sensor)
    known: bool | None = cls.__dict__.get("_built_in")
    if known is not None:
        return known
    curve = innermost(sensor)
    found = type(curve).__module__.startswith("pretouch.") and not hasattr(curve, "log_output_function")
    if found and curve is sensor and not hasattr(cls, "sensor"):
        cls._built_in = True
    return found


def innermost(sensor: SensorModel) -> SensorModel:
    """Return the curve of a sensor behind the surface, or the curve itself."""
    while isinstance(inner := getattr(sensor, "sensor", None), SensorModel):
        sensor = inner
    return sensor
