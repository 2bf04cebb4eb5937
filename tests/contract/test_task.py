"""One value for every verb: what is missing is refused in one sentence, what a verb does not use is no mistake."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import pretouch as pt
import scenario_text
from verification_samples import BOUNDS, NOISY, OBJECTIVE, SCENARIO, SENSOR, velocity_limit

TASK = pt.Task(
    SCENARIO,
    SENSOR,
    OBJECTIVE,
    bounds=BOUNDS,
    constraints=[velocity_limit(0.1, 0.9)],
    damping_ratio=(0.7, 2.0),
    uncertainty={"obstacle.velocity": pt.robust.Uniform(low=-0.4, high=-0.2)},
    loop=NOISY,
    runs=2,
)
DESIGNS = (pt.design_gain, pt.design_admittance, pt.pareto_front, pt.robust.design_robust_gain, pt.verify_gain)


@pytest.mark.parametrize("verb", DESIGNS, ids=lambda verb: verb.__name__)
def test_a_design_without_bounds_is_refused(verb: Callable[[pt.Task], Any]) -> None:
    with pytest.raises(pt.errors.InvalidInputError, match=r"^bounds: found none, expected the smallest"):
        verb(TASK.replace(bounds=None))


@pytest.mark.parametrize("verb", [pt.verify_gain, pt.simulate_encounter], ids=lambda verb: verb.__name__)
def test_a_run_without_a_loop_is_refused(verb: Callable[[pt.Task], Any]) -> None:
    with pytest.raises(pt.errors.InvalidInputError, match=r"^loop: found none, expected the sampled loop"):
        verb(TASK.replace(loop=None))


def test_a_margin_cuts_the_bounds_and_needs_a_loop() -> None:
    strongest = NOISY.stability_limit(SCENARIO, SENSOR).strongest
    assert TASK.replace(stability_margin=20.0).stable_bounds() == (strongest / 20, BOUNDS[1])
    assert TASK.stable_bounds() == BOUNDS
    with pytest.raises(pt.errors.InvalidInputError, match=r"^stability_margin: found one without a loop"):
        pt.design_gain(TASK.replace(stability_margin=20.0, loop=None))


def test_a_limit_with_a_probability_is_a_limit_of_a_design() -> None:
    (limit,) = TASK.limits
    assert pt.design_gain(TASK).gain == pt.design_gain(TASK.replace(constraints=[limit])).gain


def test_the_gain_is_the_designed_one_where_none_is_named() -> None:
    gain = pt.design_gain(TASK).gain
    assert pt.simulate_encounter(TASK).gain == pt.verify_gain(TASK, changes=False).gain == gain
    assert pt.simulate_encounter(TASK.replace(gain=-0.5)).gain == -0.5


def test_a_front_marks_the_designed_gain_where_no_choice_is_named() -> None:
    alone = TASK.replace(damping_ratio=None)
    assert pt.pareto_front(alone).choice.gain == pt.design_gain(alone).gain
    assert pt.pareto_front(alone.replace(objective=None)).choice is None


def test_a_task_is_a_value() -> None:
    assert TASK.replace() == TASK == pickle.loads(pickle.dumps(TASK))  # noqa: S301
    assert TASK.replace(constraints=list(TASK.constraints)) == TASK
    assert TASK.replace(gain=-0.5) != TASK


def test_where_a_task_was_read_does_not_change_what_it_asks(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(scenario_text.WHOLE, encoding="utf-8")
    task = pt.load_scenario(file)
    assert task.source is not None
    assert task.replace(source=None) == task
    assert pt.design_gain(task.replace(source=None)) == pt.design_gain(task)
