"""A bound that is an answer is the bound, to the bit, whichever processor has found it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.designs.problem import GainProblem, merit
from pretouch.designs.search import GainAxis
from pretouch.designs.search.freedom import make_freedom
from pretouch.designs.search.local import _to_feasible
from pretouch.designs.search.trials import Trials
from refusals import refused
from verification_samples import OBJECTIVE, SCENARIO, SENSOR, loop_of

RNG = np.random.default_rng(7)
SIZES = 10 ** RNG.uniform(-6, 6, (300, 2))
ENDS = [
    *((-float(a), -float(b)) for a, b in np.sort(SIZES[:100])[:, ::-1]),
    *((float(a), float(b)) for a, b in np.sort(SIZES[100:200])),
    *((-float(a), float(b)) for a, b in SIZES[200:]),
    *((-10.0, 0.0), (0.0, 3.0), (-1e150, -1e-150), (-1.0, -1.0 + 1e-6)),
]
# the optimum of the letter's encounter is -0.746 N s: these leave it out, so that a bound is the best there is
WEAK, STRONG = (-0.3, -0.013), (-9.7, -1.9)


@pytest.mark.parametrize("ends", ENDS[::7] + ENDS[-4:], ids=str)
def test_an_axis_of_gains_ends_at_its_bounds(ends: tuple[float, float]) -> None:
    axis = GainAxis(low=ends[0], high=ends[1])
    both = axis.coordinate(np.array(ends))
    for bound, end in zip(ends, both, strict=True):
        assert float(axis.gain(axis.coordinate(bound))) == bound
        assert float(axis.gain(end)) == bound
        for beside in (np.nextafter(end, -np.inf), np.nextafter(end, np.inf)):  # as another processor rounds
            assert float(axis.gain(beside)) == bound
    low, high = map(float, both)
    row = axis.gain(np.linspace(low, high, 65))
    assert (row[0], row[-1]) == ends
    assert ((row >= ends[0]) & (row <= ends[1])).all()
    assert (np.diff(row) > 0).all()
    if ends[0] >= 0:  # such gains make the robot chase the object
        with refused("bounds"):
            make_freedom(SCENARIO, ends, None, (0.3, 2.0))
        return
    freedom = make_freedom(SCENARIO, ends, None, (0.3, 2.0))
    assert tuple(freedom.gain(np.array([[0.0, 0.5], [1.0, 0.5]]))) == ends


@pytest.mark.parametrize("ends", [(0.3, 2.0), (0.7, 1.3), (1e-3, 1.0), (0.0, 5.0), (0.1, 0.7)], ids=str)
def test_what_is_free_ends_at_its_bounds(ends: tuple[float, float]) -> None:
    at = np.array([[0.3, 0.0, 0.0], [0.3, 1.0, 1.0]])
    frequency, ratio = make_freedom(SCENARIO, WEAK, ends, ends).admittance(at)
    assert tuple(frequency) == tuple(ratio) == ends


@pytest.mark.parametrize(("ends", "which"), [(WEAK, 0), (STRONG, 1)])
def test_a_design_at_a_bound_has_that_bound(ends: tuple[float, float], which: int) -> None:
    uncertainty = {"obstacle.velocity": pt.uncertainty.Uniform(low=-0.31, high=-0.29)}
    several = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=np.array([-0.31, -0.3, -0.29])))
    found: dict[str, Any] = {
        "gain": pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=ends)).gain,
        "closed form": pt.design(
            pt.Task(SCENARIO, pt.ExponentialFirstOrder(scale=0.458, rate=-61.0), OBJECTIVE, bounds=ends)
        ).gain,
        "loop": pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=ends, evaluate=loop_of())).gain,
        "several": set(pt.design(pt.Task(several, SENSOR, OBJECTIVE, bounds=ends)).gain),
        "robust": pt.robust(
            pt.Task(
                SCENARIO,
                SENSOR,
                OBJECTIVE,
                bounds=ends,
                uncertainty=uncertainty,
                robust=pt.designs.RobustOptions(samples=32, validation=32),
            )
        ).gain,
        "verdict": pt.verify(
            pt.Task(SCENARIO, SENSOR, OBJECTIVE, loop=loop_of(), bounds=ends, verify=pt.designs.VerifyOptions(runs=2))
        ).loss.loop_gain,
        "admittance": pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=ends, damping_ratio=(0.7, 1.3))).gain,
    }
    assert found == {name: {ends[which]} if name == "several" else ends[which] for name in found}


@pytest.mark.slow
def test_a_front_ends_at_the_bounds() -> None:
    """The stronger the gain, the slower the contact and the larger the excursion: both bounds are ends of the front."""
    for free in ({}, {"damping_ratio": (0.7, 1.3)}):
        front = pt.pareto(pt.Task(SCENARIO, SENSOR, bounds=WEAK, **free))
        assert (front.gain.min(), front.gain.max()) == WEAK
        assert not free or ((front.damping_ratio >= 0.7) & (front.damping_ratio <= 1.3)).all()


def test_a_solver_that_stops_a_rounding_before_a_bound_is_put_on_it() -> None:
    trials = Trials(
        freedom=make_freedom(SCENARIO, WEAK, None, (0.3, 2.0)),
        encounters=GainProblem(task=pt.Task(SCENARIO, SENSOR), axis=GainAxis.between(WEAK)),
        measures=(merit(OBJECTIVE, 0.3, None),),
    )

    def value(z: Any) -> float:
        return float(trials.values(z[None])[0, 0])

    best = np.array([0.0, 1.0])  # the strongest gain of those that are too weak, and much damping
    assert value(best) < value(np.array([0.01, 0.99]))
    moved = _to_feasible(trials, np.array([1e-15, 1 - 2**-52]), lambda values: float(values[0]))
    assert moved is not None
    assert moved[0].tolist() == [0.0, 1.0]
    assert moved[1] == value(moved[0])
    inside = np.array([0.4, 0.6])
    kept = _to_feasible(trials, inside, lambda values: float(values[0]))
    assert kept is not None
    assert kept[0].tolist() == inside.tolist()
