"""One value for every verb: what is missing is refused in one sentence, what a verb does not use is no mistake."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import pretouch as pt
import scenario_text
from loop_samples import BareLaw
from refusals import refused
from verification_samples import BOUNDS, NOISY, OBJECTIVE, SCENARIO, SENSOR, velocity_limit

TASK = pt.Task(
    SCENARIO,
    SENSOR,
    OBJECTIVE,
    bounds=BOUNDS,
    constraints=[velocity_limit(0.1, 0.9)],
    damping_ratio=(0.7, 2.0),
    uncertainty={"obstacle.velocity": pt.uncertainty.Uniform(low=-0.4, high=-0.2)},
    loop=NOISY,
    verify=pt.designs.VerifyOptions(runs=2),
)


class WithoutContinuous(BareLaw):
    """A law that does not name the law that it samples."""

    continuous = None  # type: ignore[assignment]


DESIGNS = (pt.design, pt.designs.design_gain, pt.pareto, pt.robust, pt.verify)


@pytest.mark.parametrize("verb", DESIGNS, ids=lambda verb: verb.__name__)
def test_a_design_without_bounds_is_refused(verb: Callable[[pt.Task], Any]) -> None:
    with refused("bounds"):
        verb(TASK.replace(bounds=None, damping_ratio=None))


@pytest.mark.parametrize("verb", [pt.verify, pt.simulate], ids=lambda verb: verb.__name__)
def test_a_run_without_a_loop_is_refused(verb: Callable[[pt.Task], Any]) -> None:
    with refused("loop"):
        verb(TASK.replace(loop=None))


def test_a_margin_cuts_the_bounds_and_needs_a_loop() -> None:
    strongest = NOISY.stability_limit(SCENARIO, SENSOR).strongest
    assert TASK.replace(stability_margin=20.0).stable_bounds() == (strongest / 20, BOUNDS[1])
    assert TASK.stable_bounds() == BOUNDS
    with refused("stability_margin"):
        pt.design(TASK.replace(stability_margin=20.0, loop=None))


def test_a_limit_with_a_probability_is_a_limit_of_a_design() -> None:
    (limit,) = TASK.limits
    assert pt.design(TASK).gain == pt.design(TASK.replace(constraints=[limit])).gain


def test_the_gain_is_the_designed_one_where_none_is_named() -> None:
    task = TASK.replace(damping_ratio=None)  # with bounds of the admittance, verify and simulate ask for one
    gain = pt.design(task).gain
    assert pt.simulate(task).gain == pt.verify(task, changes=False).gain == gain
    assert pt.simulate(task.replace(gain=-0.5)).gain == -0.5


def test_a_front_marks_the_designed_gain_where_no_choice_is_named() -> None:
    alone = TASK.replace(damping_ratio=None)
    assert pt.pareto(alone).choice.gain == pt.design(alone).gain
    assert pt.pareto(alone.replace(objective=None)).choice is None


@pytest.mark.parametrize(
    ("name", "where"),
    [
        ("samples", "it belongs in robust=RobustOptions(samples=...)"),
        ("choice", "it belongs in pareto=ParetoOptions(choice=...)"),
        ("runs", "it belongs in verify=VerifyOptions(runs=...)"),
        ("confidence", "it belongs in robust=RobustOptions(confidence=...) or verify=VerifyOptions(confidence=...)"),
        ("sampels", "did you mean robust=RobustOptions(samples=...)?"),
        ("effect", "did you mean drag_effect?"),
        ("bound", "did you mean bounds?"),
    ],
)
def test_a_name_in_the_wrong_place_is_explained(name: str, where: str) -> None:
    message = re.escape(f"Task: found an unknown name {name!r}; {where}")
    with pytest.raises(TypeError, match=f"^{message}$"):
        pt.Task(SCENARIO, SENSOR, **{name: 1})
    with pytest.raises(TypeError, match=message):
        TASK.replace(**{name: 1})


def test_a_misspelled_option_is_explained() -> None:
    with pytest.raises(TypeError, match=r"^VerifyOptions: found an unknown name 'run'; did you mean runs\?$"):
        pt.designs.VerifyOptions(run=1)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match=r"^Task: found an unknown name 'xyz'$"):
        pt.Task(SCENARIO, SENSOR, xyz=1)  # type: ignore[call-arg]


@pytest.mark.parametrize(
    ("make", "fields"),
    [
        (lambda: pt.designs.VerifyOptions(runs=0), {"argument": "runs", "value": 0}),
        (
            lambda: pt.designs.VerifyOptions(confidence=1.0),
            {"argument": "confidence", "value": 1.0, "limit": (0.0, 1.0)},
        ),
        (
            lambda: pt.designs.VerifyOptions(speed_tolerance=-0.1),
            {"argument": "speed_tolerance", "value": -0.1},
        ),
        (
            lambda: pt.designs.RobustOptions(confidence=0.0),
            {"argument": "confidence", "value": 0.0, "limit": (0.0, 1.0)},
        ),
        (
            lambda: pt.designs.ParetoOptions(quantities=["time"]),
            {"argument": "quantities"},
        ),
        (
            lambda: pt.designs.ParetoOptions(quantities=["time", "xi"]),
            {"argument": "quantities", "value": "xi"},
        ),
        (lambda: TASK.replace(robust=512), {"argument": "robust", "value": 512}),
    ],
)
def test_options_are_checked_when_they_are_made(make: Callable[[], Any], fields: dict[str, Any]) -> None:
    with refused(**fields):
        make()


@pytest.mark.slow
def test_each_verb_reads_its_own_confidence() -> None:
    sure = TASK.replace(
        damping_ratio=None,
        robust=pt.designs.RobustOptions(samples=16, validation=16, confidence=0.6),
        verify=replace(TASK.verify, confidence=0.8),
    )
    validation = pt.robust(sure).validation
    assert validation is not None
    assert (validation.confidence, pt.verify(sure, changes=False).confidence) == (0.6, 0.8)


def test_the_law_is_that_of_the_loop_unless_it_is_given() -> None:
    drag = replace(NOISY.law, law=pt.control.VirtualDrag(drag=0.0, noise=1e-3))
    assert TASK.law == pt.motion.DAMPER
    assert TASK.replace(loop=replace(NOISY, law=drag)).law == pt.motion.DRAG
    assert TASK.replace(loop=None, law="virtual-drag").law == pt.motion.DRAG
    assert TASK.replace(loop=None, law="virtual-drag").replace(gain=0.1).law == pt.motion.DRAG


def test_a_loop_without_a_law_in_continuous_time_needs_the_law_of_the_task() -> None:
    unknown = replace(NOISY, law=WithoutContinuous(-0.7, 1e-3))
    expected = r"^loop: the prediction needs .* in continuous time, but the control law WithoutContinuous has none\."
    with pytest.raises(pt.errors.InvalidInputError, match=expected):
        TASK.replace(loop=unknown)
    assert TASK.replace(loop=unknown, law="virtual-damper").replace(gain=-0.5).law == pt.motion.DAMPER


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
    assert pt.design(task.replace(source=None)) == pt.design(task)
