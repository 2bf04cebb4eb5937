"""Another rate of the sensor, another period of the law: what follows with it in a loop."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from pretouch.control import Conditioning, Controller
from pretouch.simulation import ClosedLoop, SensorChain

__all__ = ["chain_at", "controller_at", "fills_period", "loop_at", "told_period"]

_FULL: Final = 1 - 1e-9
_BELOW_HALF: Final = 0.45  # of the rate: the highest cutoff of a low-pass whose sensor becomes too slow for its own


def fills_period(chain: SensorChain) -> bool:
    """Tell whether a chain averages over its whole period.

    Args:
        chain: the chain.

    Returns:
        Whether it does.
    """
    return chain.exposure >= _FULL * chain.period


def chain_at(chain: SensorChain, rate: float) -> SensorChain:
    """Read a sensor at another rate; its exposure stays, but where a period is too short for it.

    Args:
        chain: the chain.
        rate: readings per second [Hz].

    Returns:
        The chain, whose exposure and jitter are cut to what the new period allows: continuous in the exposure.
    """
    period = 1 / rate
    return replace(chain, rate=rate, exposure=min(chain.exposure, period), jitter=min(chain.jitter, period / 4))


def told_period(controller: Controller) -> float:
    """Return the time between two readings that a controller was told [s]."""
    told = controller.conditioning.sensor_period
    return controller.period if told is None else told


def controller_at(controller: Controller, sensor_period: float, period: float | None = None) -> Controller:
    """Tell a controller that its sensor has another period.

    Args:
        controller: the controller.
        sensor_period: time between two readings [s]; never less than the controller's own period.
        period: of the controller [s]; as it is by default.

    Returns:
        The controller; a cutoff that such a sensor is too slow for is lowered to 0.45 of its rate.
    """
    own = controller.period if period is None else period
    told = max(sensor_period, own)
    c: Conditioning = controller.conditioning
    conditioning = replace(
        c,
        sensor_period=told,
        timeout=None if c.timeout is None else max(c.timeout, told),
        cutoff=None if c.cutoff is None else min(c.cutoff, _BELOW_HALF / told),
    )
    return replace(controller, period=own, conditioning=conditioning)


def loop_at(loop: ClosedLoop, rate: float) -> ClosedLoop:
    """Read the sensor of a loop at another rate; a controller that would be slower than that follows.

    Args:
        loop: the loop.
        rate: readings per second [Hz].

    Returns:
        The loop.
    """
    chain, law = chain_at(loop.chain, rate), loop.law
    if isinstance(law, Controller):
        sensor_period = told_period(law) * loop.chain.rate / rate
        law = controller_at(law, sensor_period, min(law.period, sensor_period))
    return replace(loop, chain=chain, law=law)
