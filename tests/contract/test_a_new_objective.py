"""An objective from one file of a user's own, class or function, goes where objectives go, or is refused in words."""

from __future__ import annotations

import importlib
import pickle
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
import scenario_text
from refusals import refused
from verification_samples import BOUNDS, NOISY, SCENARIO, SENSOR, velocity_limit

pytestmark = pytest.mark.usefixtures("short_rest")

FILE = '''
"""What a user's file may look like: pretouch is named in no line of it."""
from dataclasses import dataclass

@dataclass(frozen=True)
class Comfort:
    weight: float = 40.0

    def value(self, state, obstacle_speed, impact):
        return self.weight * state.displacement**2 + (state.relative_velocity / obstacle_speed) ** 2

def comfort(state):
    return 40.0 * state.displacement**2 + (state.relative_velocity / 0.3) ** 2
'''
SCENARIO_FILE = f"""
{scenario_text.SENSOR}{scenario_text.ENCOUNTER}[uncertainty]
obstacle.velocity = {{ uniform = ["-0.4 m/s", "-0.2 m/s"] }}
"""
SPEED = {"obstacle.velocity": pt.uncertainty.Uniform(low=-0.4, high=-0.2)}
SAME = pt.Objective(
    terms=(pt.Term(quantity="displacement", scale=40.0**-0.5), pt.Term(quantity="relative_velocity", scale=0.3))
)
"""The same objective as a sum of terms, where the obstacle comes with 0.3 m/s."""


@pytest.fixture(params=["Comfort", "comfort"])
def objective(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    (tmp_path / "planted_comfort.py").write_text(FILE, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    found = getattr(importlib.import_module("planted_comfort"), request.param)
    yield found() if isinstance(found, type) else found
    del sys.modules["planted_comfort"]


def task(objective: Any, **asked: Any) -> pt.Task:
    return pt.Task(SCENARIO, SENSOR, objective, **{"bounds": BOUNDS, **asked})


def test_one_gain_is_that_of_the_same_sum_of_terms(objective: Any) -> None:
    """A minimum is known to the root of the rounding of contacts, 1e-11."""
    own, terms = pt.design(task(objective)), pt.design(task(SAME))
    assert own.gain == pytest.approx(terms.gain, rel=1e-5)
    assert own.objective == pytest.approx(terms.objective, rel=1e-9)
    assert own.gradient("obstacle.position") == pytest.approx(terms.gradient("obstacle.position"), rel=1e-3)
    assert own.definition.name == getattr(objective, "__name__", "Comfort")
    again = pickle.loads(pickle.dumps(own))  # noqa: S301 - our own
    assert again == own
    assert again.certificate == own.certificate
    limited = task(objective, constraints=[velocity_limit(0.08)])
    assert pt.design(limited).certificate.at == "relative_velocity"


def test_many_gains_and_their_sweep_are_those_of_one(objective: Any, tmp_path: Path) -> None:
    speeds = np.array([-0.3, -0.25, -0.2])
    several = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=speeds))
    many = pt.design(pt.Task(several, SENSOR, objective, bounds=BOUNDS))
    for i, speed in enumerate(speeds):
        one = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=float(speed)))
        assert many.gain[i] == pytest.approx(pt.design(task(objective).replace(scenario=one)).gain, rel=1e-5)
    pytest.importorskip("xarray")
    axes = {"obstacle.velocity": speeds}
    assert pt.sweep(task(objective), axes).gain.to_numpy() == pytest.approx(many.gain, rel=1e-9)
    pytest.importorskip("zarr")
    kept = pt.sweep(task(objective), axes, output=tmp_path / "swept.zarr")
    assert kept.objective.to_numpy() == pytest.approx(many.objective, rel=1e-9)
    with pytest.raises(pt.errors.PretouchError, match="objective"):
        pt.sweep(task(SAME), axes, output=tmp_path / "swept.zarr")


def test_admittance_and_front_take_it(objective: Any) -> None:
    together, terms = (pt.design(task(f, damping_ratio=(0.7, 1.3))) for f in (objective, SAME))
    assert together.objective == pytest.approx(terms.objective, rel=1e-7)
    front = pt.pareto(task(objective))
    assert front.choice.gain == pt.design(task(objective)).gain
    assert str(front)


@pytest.mark.parametrize(
    "measure",
    [
        pt.designs.Expected(),
        pt.designs.Quantile(probability=0.9),
        pt.designs.ConditionalValueAtRisk(probability=0.9),
        pt.designs.WorstCase(),
    ],
    ids=lambda measure: type(measure).__name__,
)
def test_every_measure_takes_it(objective: Any, measure: pt.designs.Measure) -> None:
    """As for the sum of terms, to what differences in the place of gradients leave: 1e-4 of an input's range."""
    options = pt.designs.RobustOptions(measure=measure, samples=128, validation=128)
    asked = {"uncertainty": SPEED, "robust": options}
    limits = [] if isinstance(measure, pt.designs.WorstCase) else [velocity_limit(0.12, 0.8)]
    found = pt.robust(task(objective, constraints=limits, **asked))
    assert found.gain is not None
    assert float(measure.of(found.outcomes().objective)) == pytest.approx(found.validation.value)
    assert found.price("obstacle.velocity", count=3).loss.min() > -1e-6
    assert [one.name for one in found.importance] == ["obstacle.velocity"]
    assert str(found)
    if not isinstance(measure, pt.designs.WorstCase):
        return
    assert found.worst.value <= found.worst.bound
    if not callable(objective):  # which takes the obstacle's own speed
        return
    assert found.gain == pytest.approx(pt.robust(task(SAME, **asked)).gain, rel=1e-3)


@pytest.mark.slow
def test_a_loop_is_designed_and_judged_by_it(objective: Any) -> None:
    asked = task(
        objective,
        loop=NOISY,
        verify=pt.designs.VerifyOptions(runs=20),
        constraints=[velocity_limit(0.2, 0.5)],
        uncertainty=SPEED,
    )
    found = pt.verify(asked)
    assert found.loss.objective > 0
    assert getattr(objective, "__name__", "Comfort") in str(found)
    assert pt.simulate(asked).gain == found.gain
    on_loop = pt.design(task(objective, evaluate=replace(NOISY, seed=1), bounds=(-1.0, -0.5)))
    assert on_loop.ideal is not None
    assert on_loop.ideal.loss >= 0  # of the same run, where the design is the best


def test_a_file_gives_all_else_and_does_not_name_it(objective: Any, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(SCENARIO_FILE, encoding="utf-8")
    read = pt.load_scenario(path).replace(objective=objective)
    assert pt.design(read).gain == pytest.approx(pt.design(task(objective)).gain, rel=1e-9)
    path.write_text(SCENARIO_FILE.replace('"excursion"', '"comfort"'), encoding="utf-8")
    with refused("objective.kind", error=pt.errors.ScenarioFileError, value="comfort"):
        pt.load_scenario(path)


def test_one_for_a_single_contact_is_refused_where_many_are_asked_for() -> None:
    def mine(state: Any) -> float:
        return float(state.time) if state.time < 1 else 2.0

    words = (
        "objective: the user-defined objective mine failed with the error .* many contacts in one call: "
        ".* contact states had the shape"
    )
    options = {"robust": pt.designs.RobustOptions(samples=8, validation=8), "verify": pt.designs.VerifyOptions(runs=2)}
    asked = task(mine, uncertainty=SPEED, loop=NOISY, damping_ratio=(0.7, 1.3), **options)
    for verb in (pt.design, pt.robust, pt.verify, pt.pareto):
        with pytest.raises(pt.errors.InvalidInputError, match=words):
            verb(asked.replace(damping_ratio=None) if verb in {pt.robust, pt.verify} else asked)
    pytest.importorskip("xarray")
    with pytest.raises(pt.errors.InvalidInputError, match=words):
        pt.sweep(task(mine), {"obstacle.velocity": [-0.3, -0.2]})
