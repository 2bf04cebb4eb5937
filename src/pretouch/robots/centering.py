"""Center an object between two opposed fingers by moving the hand.

The control law uses the ratio of the sensor outputs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_declared, quantity
from pretouch._core.values import Value

from .site_law import SiteLaw

_DAMPED: Final = 8.0  # the gain is 1 / (8 |g| (T + delay)), so that the steepest loop is critically damped


@dataclass(frozen=True, slots=True, kw_only=True)
class Centering(Value):
    """Control law that centers an object between two opposed fingers.

    Both fingers then touch the object at the same time. The hand moves with the velocity u toward the side of the
    second finger, where T u' + u = k ln(xi_2 / xi_1). The law needs the same reflectance on both sides of the object,
    because a ratio of reflectances looks like a distance. It acts while both sensors detect an object, and ends at the
    first touch. The law of each finger stays as it is.

    Args:
        sites: names of the two sites, whose axes are opposed.
        equal_reflectance: the declaration that both sides of every object reflect alike. Without it, the law is
            refused.
        gain: k [m/s]; None for 1 / (8 |g| (T + tau)), with the steepest slope g of both curves and the delay tau from
            exposure to motion. The hand then approaches the center without oscillation.
        filter_time: T [s], which limits the acceleration of the hand.

    Examples:
        >>> Centering(sites=("left", "right"), equal_reflectance=True).filter_time
        0.005
    """

    sites: tuple[str, str]
    equal_reflectance: bool = False
    gain: float | None = quantity("m/s", None, sign="positive")
    filter_time: float = quantity("s", 5e-3, sign="positive")

    def __post_init__(self) -> None:
        check_declared(self)
        if self.sites[0] == self.sites[1]:
            raise InvalidInputError(
                f"sites: found {self.sites!r}, expected the names of two different sites", value=self.sites
            )
        if not self.equal_reflectance:
            raise InvalidInputError(
                "equal_reflectance: centering needs the same reflectance on both sides of the object. With a factor of "
                "2, one finger touches 60 ms too early and pushes the object by 7 mm. Set equal_reflectance=True only "
                "if you know that both sides reflect equally"
            )


def centering_gain(centering: Centering, laws: Sequence[SiteLaw], period: float) -> float:
    """Return the gain k [m/s] of a centering law.

    Args:
        centering: the law.
        laws: the laws of its two fingers.
        period: period of the controllers [s].

    Returns:
        The given gain, or that of a critically damped loop where the curves are steepest.
    """
    if centering.gain is not None:
        return centering.gain
    steepest, delay = 0.0, 0.0
    for law in laws:
        curve = law.site.sensor
        assert curve is not None  # noqa: S101 - checked by SiteLaw
        distances = np.linspace(curve.valid_range[0], min(curve.valid_range[1], 0.1), 100)
        steepest = max(steepest, float(np.abs(curve.log_slope(distances)).max()))
        chain = law.chain
        own = period if chain is None else 1 / chain.rate + chain.exposure / 2 + chain.delay
        delay = max(delay, own + period)
    return 1 / (_DAMPED * steepest * (centering.filter_time + delay))


@dataclass(frozen=True, slots=True)
class HandLaw:
    """Coefficients of a centering law for compiled code.

    The velocity u of the hand changes by share * (k (s_2 - s_1 + floors) - u) per period, with the filtered ln of the
    outputs of both sensors over their floors, s_1 and s_2.

    Args:
        first: index of the site along whose axis the hand moves with a positive u.
        second: index of the opposed site.
        floors: ln of the ratio of both floors.
        gain: k [m/s].
        share: share of the change per period.
    """

    first: int
    second: int
    floors: float
    gain: float
    share: float

    def along(self, site: int) -> float:
        """Return the sign of the hand motion along a site's axis.

        It is 1 for the first finger of the hand, -1 for the second, and 0 for all other sites.
        """
        return -1.0 if site == self.second else float(site == self.first)


def hand_law(centering: Centering, laws: Sequence[SiteLaw], period: float) -> HandLaw:
    """Return the coefficients of a centering law.

    Args:
        centering: the law.
        laws: the laws of all sites.
        period: period of the controllers [s].
    """
    first, second = pair_of(centering, laws)
    pair = laws[first], laws[second]
    floors = math.log(pair[1].controller.conditioning.floor / pair[0].controller.conditioning.floor)
    share = -math.expm1(-period / centering.filter_time)
    return HandLaw(first, second, floors, centering_gain(centering, pair, period), share)


def pair_of(centering: Centering, laws: Sequence[SiteLaw]) -> tuple[int, int]:
    """Return the indices of the control laws of the two fingers."""
    names = [law.site.name for law in laws]
    for site in centering.sites:
        if site not in names:
            raise InvalidInputError(
                f"centering: found no control law for the site {site!r}; sites with a control law: {', '.join(names)}",
                value=site,
            )
    first, second = (names.index(site) for site in centering.sites)
    return first, second
