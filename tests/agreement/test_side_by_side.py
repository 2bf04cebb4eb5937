"""Encounters of the sampled loop that run side by side are those that run alone, to the last bit."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.simulation import native_loop

COUNT = 45  # no multiple of the lanes of any processor, so that lanes begin and end at different times
CONDITIONING: dict[str, Any] = {"floor": 1e-3, "sensor_period": 4e-3}
CHAIN = pt.SensorChain(
    rate=250.0, exposure=170e-6, delay=120e-6, random_phase=True, noise=1e-3, relative_noise=2e-3, resolution=1e-4
)
SERVO = pt.simulation.ImpedancePlant(mass=4.0, stiffness=4000.0, damping=250.0, bandwidth=80.0, coulomb_friction=1.0)
ADMITTANCE = pt.control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0)
SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
CONTACT = pt.simulation.HuntCrossley(stiffness=1.33e6, dissipation=0.5, obstacle_mass=1.5)


def loop(chain: pt.SensorChain = CHAIN, *, limits: dict[str, float] | None = None, **parts: Any) -> pt.ClosedLoop:
    conditioning = pt.control.Conditioning(**CONDITIONING | parts.pop("conditioning", {}))
    law = pt.control.Controller(
        period=1e-3,
        conditioning=conditioning,
        law=parts.pop("law", pt.control.VirtualDamper(gain=0.0)),
        admittance=ADMITTANCE,
        limits=pt.control.Limits(**limits or {}),
    )
    return pt.ClosedLoop(law=law, chain=chain, **{"horizon": 1.5, **parts})


LOOPS = {
    "ideal": loop(),
    "robot": loop(plant=SERVO),
    "robot without lag": loop(plant=pt.simulation.ImpedancePlant(mass=2.0, stiffness=900.0, damping=60.0)),
    "contact": loop(plant=SERVO, contact=CONTACT),
    "end before contact": loop(plant=SERVO, horizon=0.1),
    "limits": loop(limits={"force": 2.0, "speed": 0.05, "acceleration": 3.0, "excursion": 0.01}),
    "limits of a robot": loop(plant=SERVO, limits={"force": 5.0, "excursion": 0.02}),
    "filters": loop(
        conditioning={
            "median_window": 3,
            "moving_average": 4,
            "low_pass_order": 3,
            "cutoff": 40.0,
            "largest_rate": 120.0,
        }
    ),
    "approach only": loop(law=pt.control.VirtualDamper(gain=0.0, approach_only=True)),
    "late and lost readings": loop(
        replace(CHAIN, jitter=1e-3, dropout=0.4, drift=1e-4), conditioning={"timeout": 9e-3}
    ),
    "misfit": loop(replace(CHAIN, misfit=0.02, misfit_length=0.01)),
    "vanishing object": loop(
        replace(
            CHAIN,
            measures_distance=True,
            dropout=0.3,
            disturbances=[
                pt.simulation.Disturbance(kind="object-leaves", time=t, duration=d)
                for t, d in ((0.02, 0.01), (0.05, 0.02), (0.1, 0.05))
            ],
        )
    ),
    "at once": loop(replace(CHAIN, exposure=0.0, delay=0.0, random_phase=False)),
}
GAINS = np.array([0.0, -0.1, -0.7463, -3.0])  # the last one is unstable on most loops


def encounters(*, course: bool = False) -> pt.Scenario:
    """Return random encounters; sections of a course end within periods, at their ends, and several in one period."""
    rng = np.random.default_rng(3)
    obstacle = pt.Obstacle(
        position=np.append(rng.uniform(0.02, 0.08, COUNT - 2), [1e-9, 0.05]),
        velocity=np.append(-rng.uniform(0.05, 0.6, COUNT - 2), [-0.1, 0.0]),  # at once; never
        acceleration=rng.uniform(-0.2, 0.2, COUNT),
    )
    if course:
        first = np.where(np.arange(COUNT) % 3, rng.uniform(1e-4, 0.1, COUNT), np.arange(COUNT) * 1e-3 + 0.01)
        ends = first, first + 3e-4, first + np.where(np.arange(COUNT) % 2, 0.05, 4e-4), first + 0.2
        accelerations = (rng.uniform(-3.0, 3.0, COUNT) for _ in ends)
        stretches = (pt.motion.Stretch(until=t, acceleration=a) for t, a in zip(ends, accelerations, strict=True))
        obstacle = replace(obstacle, course=tuple(stretches))
    admittance = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
    reference = pt.Reference(velocity=rng.uniform(-0.02, 0.02, COUNT), acceleration=0.01)
    return pt.Scenario(admittance=admittance, obstacle=obstacle, reference=reference)


def runs(name: str, *, alone: bool, course: bool = False) -> tuple[np.ndarray, np.ndarray]:
    whole = LOOPS[name].encounters(encounters(course=course), (SENSOR,), GAINS[:, None], None)
    indices = np.arange(GAINS.size * COUNT)
    parts = np.split(indices, len(indices)) if alone else [indices]  # one run is never one of several lanes
    results = [native_loop.run_loop(whole, part) for part in parts]
    return np.concatenate([r[0] for r in results]), np.concatenate([r[1] for r in results])


@pytest.mark.slow(keep=6)
@pytest.mark.parametrize("course", [False, True], ids=["constant acceleration", "course"])
@pytest.mark.parametrize("name", LOOPS)
def test_encounters_side_by_side_have_the_bits_of_encounters_alone(name: str, *, course: bool) -> None:
    together, alone = runs(name, alone=False, course=course), runs(name, alone=True, course=course)
    for column, own in zip(together[0].T, alone[0].T, strict=True):
        assert np.array_equal(column, own, equal_nan=True)
    assert np.array_equal(together[1], alone[1], equal_nan=True)


@pytest.mark.parametrize(
    ("name", "flag"), [("limits", pt.control.Status.MOTION_LIMITED), ("late and lost readings", pt.control.Status.LOST)]
)
def test_the_loops_reach_what_they_are_made_for(name: str, flag: pt.control.Status) -> None:
    flags = runs(name, alone=False)[0][:, native_loop.RESULT_COLUMNS.index("flags")].astype(int)
    assert (flags & flag).any()


@pytest.mark.parametrize("variant", ["base", "avx2"])
def test_every_processor_gives_the_same_bits(variant: str) -> None:
    program = (
        "import test_side_by_side as t; print(t.runs('limits of a robot', alone=False, course=True)[0].tobytes().hex())"
    )
    environment = {**os.environ, "PRETOUCH_VARIANT": variant, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if "which this processor does not support" in done.stderr:
        pytest.skip(f"this processor does not support {variant}")
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == runs("limits of a robot", alone=False, course=True)[0].tobytes().hex()
