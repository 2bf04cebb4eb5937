"""Loops to be judged: the letter's encounter, controller and sensor, with one thing after the other made real."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any
from unittest import mock

import pretouch as pt
from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
from pretouch.simulation import ClosedLoop
from pretouch.verification import at_rest

SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
)
OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
BOUNDS = (-10.0, -0.01)
ADMITTANCE = VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0)


def controller(period: float, **conditioning: Any) -> Controller:
    """The letter's controller without filters."""
    return Controller(
        period=period,
        conditioning=Conditioning(**{"floor": 0.0455} | conditioning),
        law=VirtualDamper(gain=0.0),
        admittance=ADMITTANCE,
    )


def loop_of(period: float = 1e-3, rate: float = 250.0, conditioning: Any = None, **chain: Any) -> ClosedLoop:
    """A loop whose controller is told the rate of its sensor."""
    law = controller(period, sensor_period=1 / rate, **(conditioning or {}))
    return ClosedLoop(law=law, chain=pt.SensorChain(rate=rate, **chain))


NOISY = loop_of(exposure=170e-6, delay=120e-6, noise=1e-3, relative_noise=2e-3, random_phase=True)
QUICK = replace(loop_of(period=1e-4, rate=1e4), seed=3)


@contextmanager
def short_rest() -> Iterator[None]:
    """Let a robot rest for 0.3 s instead of 30 s: two thirds of the time of a verdict of few runs."""
    with mock.patch.object(at_rest, "_REST", 0.3):
        yield


def verdict(
    loop: ClosedLoop,
    *,
    changes: bool = True,
    runs: int = 60,
    confidence: float = 0.95,
    speed_tolerance: float = 0.1,
    **fields: Any,
) -> pt.verification.Verdict:
    """Judge the letter's encounter."""
    verify = pt.designs.VerifyOptions(runs=runs, confidence=confidence, speed_tolerance=speed_tolerance)
    given = {"bounds": BOUNDS, "verify": verify} | fields
    return pt.verify(pt.Task(SCENARIO, SENSOR, OBJECTIVE, loop=loop, **given), changes=changes)


def velocity_limit(limit: float, probability: float = 1.0) -> pt.designs.Required:
    """A limit of the speed at contact."""
    return pt.designs.Required(constraint=pt.Constraint(name="relative_velocity", limit=limit), probability=probability)
