"""A law of a user's own is one file, as this one: it goes through every verb that the letter's goes through.

It is the letter's with a gain that two sensors share, so that whatever is found can be compared with the letter's.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import pretouch as pt
from pretouch.control import CompiledStep, Law, Parts, Push, VirtualDamper, drive, observe
from pretouch.motion import DAMPER, ContinuousLaw, CustomLaw, LawNumber
from pretouch.report import write_report
from refusals import refused
from verification_samples import BOUNDS, NOISY, OBJECTIVE, SCENARIO, SENSOR, verdict

pytestmark = pytest.mark.usefixtures("short_rest")

MANY = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=np.linspace(-0.35, -0.25, 5)))
SHARE = 0.5


@dataclass(frozen=True)
class SharedDamper:
    """In continuous time."""

    share: float = SHARE

    kind: ClassVar[str] = "shared-damper"
    number: ClassVar[LawNumber] = LawNumber("gain", "D_s", "N*s", -1)
    degree: ClassVar[int] = 1

    def contact(self, scenario: Any, sensor: Any, value: Any, **how: Any) -> pt.motion.ContactResult:
        return DAMPER.contact(scenario, sensor, self.share * value, **how)

    def motion(self, scenario: Any, sensor: Any, value: Any, **how: Any) -> pt.motion.Motion:
        return DAMPER.motion(scenario, sensor, self.share * value, **how)

    def damping(self, value: Any, slope: Any, relative_velocity: Any) -> Any:
        return DAMPER.damping(self.share * value, slope, relative_velocity)


@dataclass(frozen=True, kw_only=True)
class Shared:
    """Sampled, as one compiled step runs it."""

    gain: float
    share: float = SHARE

    @property
    def continuous(self) -> SharedDamper:
        return SharedDamper(self.share)

    @property
    def value(self) -> float:
        return self.gain

    @property
    def step(self) -> Any:
        return CompiledStep("step_damper")

    def _letters(self) -> VirtualDamper:
        return VirtualDamper(gain=self.share * self.gain)

    def numbers(self, controller: Any) -> Any:
        return self._letters().numbers(controller)

    def start(self) -> Any:
        return self._letters().start()

    def with_value(self, value: float) -> Shared:
        return replace(self, gain=value)


class SharedInPython(Shared):
    """Sampled, of the building blocks in Python."""

    @property
    def step(self) -> Any:
        return _step

    def numbers(self, controller: Any) -> Any:  # noqa: ARG002
        return self.share * self.gain

    def start(self) -> Any:
        return None


def _step(parameters: Any, state: Any, sample: Any) -> Any:
    sensing, seen = observe(parameters.sensing, state.sensing, sample)
    push = Push(parameters.law * seen.change, 0.0)
    driven, output = drive(parameters.drive, state.drive, seen, push, sample)
    return Parts(sensing, driven, state.law), output


OWN = SharedDamper()
LOOP = replace(NOISY, law=replace(NOISY.law, law=Shared(gain=0.0)))
KINDS: list[type[Shared]] = [Shared, SharedInPython]


def task(law: ContinuousLaw, **asked: Any) -> pt.Task:
    """A problem whose gains are those of the letter's over the share."""
    share = 1.0 if law == DAMPER else SHARE
    given = {"bounds": tuple(bound / share for bound in BOUNDS)} | asked
    return pt.Task(SCENARIO, SENSOR, OBJECTIVE, law=law, **given)


def robust(law: ContinuousLaw) -> Any:
    speed = {"obstacle.velocity": pt.uncertainty.Uniform(low=-0.35, high=-0.25)}
    options = pt.designs.RobustOptions(samples=16, validation=16)
    return pt.robust(task(law, uncertainty=speed, robust=options)).gain


def swept(law: ContinuousLaw) -> Any:
    axes = {"obstacle.velocity": [-0.35, -0.25]}
    return pt.sweep(task(law), axes, results=["gain"])["gain"].values


QUANTITIES = pt.designs.ParetoOptions(quantities=("relative_velocity", "largest_excursion"))
LIMIT = [pt.Constraint(name="excursion", limit=0.05)]
VERBS: dict[str, Callable[[ContinuousLaw], Any]] = {
    "design_gain": lambda law: pt.design(task(law)).gain,
    "design_gain with a limit": lambda law: pt.design(task(law, constraints=LIMIT)).gain,
    "pareto": lambda law: pt.pareto(task(law, pareto=QUANTITIES)).knee.gain,
    "robust": robust,
    "sweep": swept,
}


def test_it_has_all_members() -> None:
    assert isinstance(OWN, ContinuousLaw)
    law: Law = Shared(gain=-1.0)
    assert law.with_value(-2.0).value == -2.0
    assert pickle.loads(pickle.dumps(LOOP)) == LOOP  # noqa: S301


def test_its_encounters_are_solved_by_itself() -> None:
    ours, theirs = pt.find_contact(MANY, SENSOR, -1.2, law=OWN), pt.find_contact(MANY, SENSOR, -0.6)
    np.testing.assert_array_equal(ours.contact.relative_velocity, theirs.contact.relative_velocity)
    moved, led = pt.solve_motion(SCENARIO, SENSOR, -1.2, law=OWN), pt.solve_motion(SCENARIO, SENSOR, -0.6)
    np.testing.assert_array_equal(moved.distance, led.distance)


@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_chooses_its_number(verb: str) -> None:
    """Searches end where the objective no longer changes, which tells a minimum to the root of rounding, 1e-8."""
    np.testing.assert_allclose(SHARE * np.asarray(VERBS[verb](OWN)), VERBS[verb](DAMPER), rtol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_it_stands_in_the_controller(kind: type[Shared]) -> None:
    own = replace(NOISY, law=replace(NOISY.law, law=kind(gain=0.0)))
    ours, theirs = own.run(MANY, SENSOR, -1.2, runs=2), NOISY.run(MANY, SENSOR, -0.6, runs=2)
    np.testing.assert_array_equal(ours.relative_velocity, theirs.relative_velocity)


@pytest.mark.slow
def test_a_loop_is_designed_for_and_judged_with_it(tmp_path: Path) -> None:
    assert pt.Task(SCENARIO, SENSOR, loop=LOOP).law == OWN
    found = verdict(LOOP, gain=-1.2, runs=8, changes=False)
    assert found.law == OWN
    assert found.predicted.end.relative_velocity == pt.find_contact(SCENARIO, SENSOR, -0.6).end.relative_velocity
    one = pt.simulate(pt.Task(SCENARIO, SENSOR, loop=LOOP, gain=-1.2))
    assert one.law == OWN
    for name, result in (("verdict", found), ("encounter", one), ("design", pt.design(task(OWN)))):
        write_report(result, tmp_path / f"{name}.html")
    for name in ("verdict", "encounter"):
        assert "Shared" in (tmp_path / f"{name}.html").read_text(encoding="utf-8")
    with refused("law"):
        verdict(LOOP, gain=-1.2, law="virtual-damper")


def test_any_force_is_such_a_law() -> None:
    """The letter's, as `CustomLaw` integrates it: 1e-13 of the motion a step, over some hundred steps."""
    force = CustomLaw(kind="letter", number=DAMPER.number, force=lambda gain, _, rate: gain * rate)
    ours, theirs = pt.find_contact(MANY, SENSOR, -0.6, law=force), pt.find_contact(MANY, SENSOR, -0.6)
    np.testing.assert_allclose(ours.contact.relative_velocity, theirs.contact.relative_velocity, rtol=1e-11)
