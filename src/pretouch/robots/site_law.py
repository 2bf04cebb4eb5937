"""Combine a sensor on the robot with its controller.

The sensor model includes sampling, noise and delay.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import check_declared, quantity
from pretouch.control import Controller, VirtualDamper
from pretouch.simulation import SensorChain

from .site import SensorSite


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteLaw:
    """The controller of one sensor site, with a sensor model.

    The sensor model includes sampling, noise and delay.

    Args:
        site: the sensor site, with its curve.
        controller: the controller that the robot runs for this site.
        chain: the sensor chain; by default one reading per controller period, without noise and delay.
        one_sided: whether the law only acts while an object approaches. Otherwise, a robot with a two-sided law follows
            an object that recedes or leaves the beam, and may hit it at a high speed.
        approach: velocity with which the task moves the reference of the site along its axis [m/s], positive toward
            objects. The robot starts with this velocity.
    """

    site: SensorSite
    controller: Controller
    chain: SensorChain | None = None
    one_sided: bool = True
    approach: float = quantity("m/s", 0.0)

    def __post_init__(self) -> None:
        check_declared(self)
        if self.site.sensor is None:
            raise InvalidInputError(
                f"site {self.site.name!r}: this site has no sensor curve; set one with SensorSite(name, sensor=curve)"
            )

    @property
    def running(self) -> Controller:
        """The controller that runs on the robot, one-sided if requested.

        If `one_sided` is True, a virtual damper acts during approaches only.
        """
        law = self.controller.law
        if self.one_sided and isinstance(law, VirtualDamper) and not law.approach_only:
            return replace(self.controller, law=replace(law, approach_only=True))
        return self.controller
