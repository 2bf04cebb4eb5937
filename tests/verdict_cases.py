"""Verdicts of every status to draw and to print, each made once in a session."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from loop_samples import BareLaw
from pretouch._core.errors import ResultUnavailableError
from pretouch.report import plots
from pretouch.simulation import ClosedLoop
from verification_samples import (
    BOUNDS,
    NOISY,
    OBJECTIVE,
    SCENARIO,
    SENSOR,
    controller,
    loop_of,
    short_rest,
    velocity_limit,
    verdict,
)

COUNTS = pt.InversePower(scale=0.13, distance_offset=0.0419, exponent=3.32)
ROBOT = pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0, bandwidth=60.0, coulomb_friction=1.0)
CONTACT = pt.simulation.HuntCrossley(stiffness=2e6, dissipation=1.0)
SPEED = {"obstacle.velocity": pt.uncertainty.TruncatedNormal(location=-0.3, deviation=0.05, low=-0.4, high=-0.2)}
DRAWERS = (plots.verdict, plots.verdict_run, plots.verdict_stability, plots.verdict_gain)
STATUS = {"holds": "holds", "holds-narrowly": "holds narrowly", "does-not-hold": "does not hold", "no-gain": "no gain"}


@dataclass(frozen=True)
class TunedLaw(BareLaw):
    """A law of somebody's own: no `Controller`, so that nothing is known of its stability."""

    def with_value(self, value: float) -> TunedLaw:
        return replace(self, gain=value)


def limit(name: str, size: float, probability: float = 1.0) -> pt.designs.Required:
    return pt.designs.Required(constraint=pt.Constraint(name=name, limit=size), probability=probability)


def pushing(
    part: str, sensor: Any, conditioning: dict[str, float], *, runs: int = 40, **fields: Any
) -> pt.verification.Verdict:
    """A part's data sheet, a robot behind an impedance controller, and a contact with a force."""
    loop = ClosedLoop(
        law=controller(1e-3, **conditioning), chain=pt.simulation.sensor_part(part).chain, plant=ROBOT, contact=CONTACT
    )
    verify = pt.designs.VerifyOptions(runs=runs)
    return pt.verify(pt.Task(SCENARIO, sensor, OBJECTIVE, loop=loop, bounds=BOUNDS, verify=verify, **fields))


def tof(part: str, rate: float, *limits: pt.designs.Required, runs: int = 20) -> pt.verification.Verdict:
    return pushing(part, SENSOR, {"sensor_period": 1 / rate}, constraints=limits, runs=runs)


CASES: dict[str, Callable[[], pt.verification.Verdict]] = {
    "VCNL4010 that pushes": lambda: pushing(
        "VCNL4010",
        COUNTS,
        {"floor": 460.0, "sensor_period": 4e-3},
        uncertainty=SPEED,
        constraints=[
            limit("relative_velocity", 0.12, 0.9),
            limit("excursion", 0.2),
            limit("impact_force", 400.0, 0.9),
        ],
    ),
    "4x4 that oscillates": lambda: tof("VL53L5CX-4x4", 60.0, limit("excursion", 0.3), runs=80),
    "8x8 that is too slow": lambda: tof("VL53L5CX-8x8", 15.0, limit("relative_velocity", 0.25, 0.9)),
    "ideal robot": lambda: verdict(NOISY, constraints=[velocity_limit(0.1, 0.9)], runs=40),
    "no gain": lambda: verdict(NOISY, constraints=[velocity_limit(0.001)], changes=False),
    "a law of one's own": lambda: verdict(
        ClosedLoop(
            law=TunedLaw(gain=0.0, period=1e-3, hold=4e-3), chain=pt.SensorChain(rate=250.0, relative_noise=2e-3)
        ),
        runs=20,
    ),
    "one run, no changes": lambda: verdict(loop_of(), runs=1, changes=False),
    "never in time": lambda: verdict(
        replace(NOISY, horizon=0.464, seed=1),
        runs=5,
        uncertainty={"obstacle.velocity": pt.uncertainty.Uniform(low=-0.3, high=-0.05)},
    ),
    "no mitigation at all": lambda: verdict(loop_of(), runs=3, gain=0.0, changes=False),
    "a gain that drives on": lambda: verdict(loop_of(), runs=3, gain=0.05, bounds=(-2.0, 1.0)),
    "limits of forces by an impact model": lambda: verdict(
        NOISY,
        runs=10,
        constraints=[limit("drive_force", 30.0), limit("impact_force", 30.0, 0.5), limit("travel", 0.2)],
        impact=pt.SpringImpact(robot_mass=2.0, stiffness=1e4),
        changes=False,
    ),
}


@cache
def case(name: str) -> pt.verification.Verdict:
    with short_rest():
        return CASES[name]()


def drawn(draw: Any, of: pt.verification.Verdict) -> Any:
    """The figure; None where there is nothing to draw, which must be for a reason that the verdict has."""
    missing = {
        plots.verdict: of.gain is None,
        plots.verdict_run: of.gain is None,
        plots.verdict_stability: of.stability is None,
        plots.verdict_gain: not np.isfinite(of.design.trade_off.objective).any(),
    }
    if missing[draw]:
        with pytest.raises(ResultUnavailableError):
            draw(of)
        return None
    return draw(of)
