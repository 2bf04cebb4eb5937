"""Define the inverse power curve, which describes most optical proximity sensors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity

from .family import Family
from .model import SensorModel, parameter
from .sensitivity import CurveSensitivity, CurveSimilarity

_HEAVIEST_KAPPA: Final = 1 / 0.7
"""Largest 1 / n, that of the flattest inverse power that is considered."""

_EXPONENTIAL_KAPPA: Final = 1e-6
"""Smallest 1 / n; the curve then equals an exponential."""

_FLAT_TAIL: Final = 0.65  # standard deviation of the prior of ln(2 / n)
_POINT_SOURCE: Final = 2.0  # the exponent of a point light source


@dataclass(frozen=True, slots=True, kw_only=True)
class _InversePowerFamily(Family):
    """Family of inverse power sensor curves.

    The fit parameters are u = (ln xi(l_m), ln r_1, kappa) with r_1 = -1 / g at the first distance and kappa = 1 / n;
    l_m is the middle of the calibration window.

    g = -1 / (r + kappa (l - l_m)) with kappa = 1 / n and r = (l_m + l_0) / n becomes the exponential as kappa -> 0.
    """

    kappa_max: float = 10.0
    kappa_floor: float = 0.0

    compiled: ClassVar[int] = 2
    informs: ClassVar[bool] = True

    @property
    def kappa_min(self) -> float:
        """The smallest inverse exponent 1 / n in a fit.

        A smaller value would give nearly an exponential curve.
        """
        return self.kappa_floor or next(
            (1 / n for n in (200, 100, 50) if n * abs(math.log(n * self.span)) < 500), 1 / 20
        )

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        reach = math.log(self.span)
        low = [-np.inf, reach - 12, self.kappa_min]
        return np.array(low), np.array([np.inf, reach + 6, self.kappa_max])

    def start(self, log_middle: float, slope: float, curvature: float) -> FloatArray:
        kappa = min(max(curvature / slope**2, 0.05), 0.9 * self.kappa_max)
        first = max(-1 / slope - kappa * (self.middle - self.first), 0.1 * self.span)
        return np.array([log_middle, math.log(first), kappa])

    def _radius(self, u: FloatArray) -> FloatArray:
        return np.asarray(np.exp(u[..., 1]) + u[..., 2] * (self.middle - self.first))

    def log_output(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        kappa, radius = u[..., 2, None], self._radius(u)[..., None]
        return np.asarray(u[..., 0, None] - np.log1p(kappa * (distance - self.middle) / radius) / kappa)

    def slope(self, u: FloatArray, distance: FloatArray) -> FloatArray:
        return np.asarray(-1 / (self._radius(u)[..., None] + u[..., 2, None] * (distance - self.middle)))

    def coordinates(self, u: FloatArray) -> FloatArray:
        inverse = np.log(u[..., 2] / self._radius(u))  # of 1 / (l_m + l_0)
        return np.stack([u[..., 0] - inverse / u[..., 2], inverse, np.log(u[..., 2])], axis=-1)

    def parameters(self, coordinates: FloatArray) -> FloatArray:
        q = np.asarray(coordinates, dtype=np.float64)
        with np.errstate(over="ignore", divide="ignore"):
            return np.array([np.exp(q[0]), np.exp(-q[1]) - self.middle, np.exp(-q[2])])

    def written(self, u: FloatArray) -> FloatArray:
        q = self.coordinates(u)
        while abs(q[0]) > 600 and q[2] < 0:  # nearly constant slope: keep g(l_m) and raise kappa
            kappa = 2 * math.exp(q[2])
            radius = float(self._radius(u)) - kappa * (self.middle - self.first)
            u = np.array([u[0], math.log(max(radius, 1e-3 * self.span)), kappa])
            q = self.coordinates(u)
        return self.parameters(q)

    @classmethod
    def at_large(cls, curve: Any, first: float, last: float) -> _InversePowerFamily:
        return cls(curve=curve, first=first, last=last, kappa_max=_HEAVIEST_KAPPA, kappa_floor=_EXPONENTIAL_KAPPA)

    def prior(self, u: FloatArray) -> FloatArray:
        """Return an extra fit cost for small exponents.

        Exponents n below 2 have this cost, because light of a small source decays at least as 1 / l^2. Clear evidence
        outweighs it: n = 1 costs 1.1, and no exponent costs more than 3.8, the square of the half width of a 95 %
        interval in standard deviations.
        """
        return np.asarray(np.minimum((np.maximum(np.log(2 * u[:, 2]), 0.0) / _FLAT_TAIL) ** 2, 3.8))

    def runs_away(self, ends: Any) -> bool:
        """Return True if the exponent n has no upper limit.

        Then the readings allow an inverse exponent 1 / n of zero.
        """
        low, _, reached, _ = ends[2]
        return bool(not reached or low <= math.log(1.05 * float(self.bounds[0][2])))

    def identifiability_remarks(self, parameters: Mapping[str, Any], slope: Any, *, runaway: bool) -> tuple[str, ...]:
        if not runaway:
            return ()
        at, low = format_quantity(self.middle, "m"), parameters["exponent"].low
        return (
            "The exponent n and the distance offset l_0 can grow together: an exponential curve fits equally well. "
            f"The readings determine only the slope n / (l_0 + {at}) = {-slope.value:.4g} 1/m. This is the slope in "
            f"the middle of the usable range. The exponent is above {low:.3g} and has no upper limit.",
        )

    def remarks(self, parameters: Mapping[str, Any], *, at_bound: bool) -> tuple[str, ...]:  # noqa: ARG002
        exponent = parameters["exponent"]
        if not exponent.value < _POINT_SOURCE:
            return ()
        return (
            f"The fitted exponent is {exponent.value:.3g}, but a point light source has the exponent 2. The 95 % "
            f"interval of the fitted exponent ends at {exponent.high:.3g}. A large object, a row of emitters, or an "
            "offset that was not subtracted can make the exponent small.",
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class InversePower(SensorModel):
    """Inverse power sensor curve.

    The output at the distance l is xi = scale / (l + l_0)^n, equation L(3).

    Args:
        scale: alpha beta psi > 0, in the unit of the output times m^n; it does not affect the motion.
        distance_offset: l_0 [m], from the virtual source to the contact surface; l + l_0 must stay positive.
        exponent: n > 0, the diffusion exponent.
        minimum_distance: smallest valid l [m].
        maximum_distance: largest valid l [m].

    Examples:
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> round(sensor.log_slope(0.0), 3)
        -79.236
    """

    scale: float = parameter("alpha beta psi", "", sign="positive", example="1.0", of_output="m^n")
    distance_offset: float = parameter("l_0", "m", example='"41.9 mm"')
    exponent: float = parameter("n", "", sign="positive", example="3.32")

    name: ClassVar[str] = "inverse-power"
    family: ClassVar[type[Family]] = _InversePowerFamily

    def __post_init__(self) -> None:
        SensorModel.__post_init__(self)
        offset = self.distance_offset
        if not self.minimum_distance + offset > 0:
            raise InvalidInputError(
                f"distance_offset: found {offset:g} m, expected more than {0.0 - self.minimum_distance:g} m, "
                "the negative of minimum_distance. Otherwise, the output is infinite inside the valid range",
                value=offset,
            )

    def _sensitivity_to(self, name: str) -> CurveSensitivity | None:
        sensitivities = {
            "scale": CurveSensitivity(),
            "distance_offset": CurveSensitivity(shift=1.0),
            "exponent": CurveSensitivity(output=1 / self.exponent),
        }
        return sensitivities.get(name)

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return np.asarray(np.log(self.scale) - self.exponent * np.log(distance + self.distance_offset))

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        return np.asarray(-self.exponent / (distance + self.distance_offset))

    def _similarity(
        self,
        values: Mapping[str, FloatArray],
        recess: FloatArray,
        distance: Any,  # noqa: ARG002
    ) -> CurveSimilarity | None:
        """Return factors that convert inverse power curves to one reference curve. They scale length and gain.

        For g = -n / (l + l_0), lengths scale with s = L_0 / l_0, and the gain with s n / N.
        """
        offset = np.asarray(values.get("distance_offset", self.distance_offset)) + recess
        exponent = np.asarray(values.get("exponent", self.exponent))
        if not (np.all(offset > 0) and np.all(exponent > 0)):
            return None
        reference = float(np.median(offset))
        length = reference / offset
        return CurveSimilarity(
            curve=replace(self, minimum_distance=0.0, maximum_distance=np.inf, distance_offset=reference),
            length=length,
            gain=length * (exponent / self.exponent),
            parameters={
                "exponent": (0.0, 1 / exponent),
                "distance_offset": (-1 / offset, -1 / offset),
                "recess": (-1 / offset, -1 / offset),
            },
        )
