"""A robot or a contact of a user's own is one class in one place: it goes wherever those of pretouch go."""

from __future__ import annotations

import inspect
import math
import pickle
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from command_text import command, strict
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

import pretouch as pt
from installed import install
from pretouch._core.blocks import Measured
from pretouch._core.fields import check_declared, quantity
from pretouch.report import write_report
from pretouch.simulation import (
    ContactModel,
    ImpedancePlant,
    LinearPlant,
    PlantModel,
    SpringDamper,
    StateSpace,
    StateSpacePlant,
    gain_limit,
    timing_of,
)
from refusals import refused
from verification_samples import BOUNDS, NOISY, OBJECTIVE, SCENARIO, SENSOR, verdict

pytestmark = pytest.mark.usefixtures("short_rest")

ROOT = Path(__file__).parents[2]
MANY = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=np.linspace(-0.35, -0.25, 5)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Geared(PlantModel):
    """A motor behind a gear, under an impedance controller."""

    kind: ClassVar[str] = "geared"

    inertia: float = quantity("kg*m^2", sign="positive")
    pitch: float = quantity("m", sign="positive")

    def __post_init__(self) -> None:
        check_declared(self)

    def coefficients(self) -> tuple[float, ...]:
        mass = self.inertia / self.pitch**2
        return mass, 4000.0, 180.0, 180.0, mass, 0.0, 0.0, 1e-3

    def rows(self) -> Iterator[tuple[str, Any]]:
        yield "robot", "a motor behind a gear"
        yield "pitch radius", Measured(self.pitch, "m")


@dataclass(frozen=True, slots=True, kw_only=True)
class Felt(ContactModel):
    """A layer that is the stiffer the thinner it is."""

    kind: ClassVar[str] = "felt"

    modulus: float = quantity("N/m^2", sign="positive")
    thickness: float = quantity("m", sign="positive")

    def numbers(self) -> tuple[float, float, float, bool, float]:
        return self.modulus * 1e-4 / self.thickness, 60.0, 1.0, False, 1 / self.obstacle_mass


OURS = (
    ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0),
    SpringDamper(stiffness=3e4, damping=60.0, obstacle_mass=1.0),
)
OWN = Geared(inertia=2e-2, pitch=0.1), Felt(modulus=6e5, thickness=2e-3, obstacle_mass=1.0)
LOOP = replace(NOISY, plant=OWN[0], contact=OWN[1])


def test_the_numbers_of_both_are_the_same() -> None:
    """So that all that follows can be compared: 2e-2 kg m^2 / (0.1 m)^2 is 2 kg, 6e5 N/m^2 x 1 cm^2 / 2 mm 3e4 N/m."""
    assert OWN[0].coefficients() == pytest.approx(OURS[0].coefficients(), rel=1e-15)
    assert OWN[1].numbers() == pytest.approx(OURS[1].numbers(), rel=1e-15)


def test_encounters_are_run_with_them() -> None:
    law = NOISY.law.with_value(-0.6)
    theirs, ours = (
        pt.simulation.simulate_loop(MANY, SENSOR, law, chain=NOISY.chain, runs=2, seed=3, plant=plant, contact=contact)
        for plant, contact in (OWN, OURS)
    )
    for name in ("time", "relative_velocity", "peak_force", "impulse", "rebound_velocity"):
        # numbers may differ in their last bit, 1e-16, which some hundred steps and a contact let grow a little
        np.testing.assert_allclose(getattr(theirs, name), getattr(ours, name), rtol=1e-9)
    assert len(theirs.trace((1, 3)).contacts) == theirs.contacts[1, 3]
    assert pickle.loads(pickle.dumps(LOOP)) == LOOP  # noqa: S301


def test_stability_is_told_of_them() -> None:
    distance = np.linspace(0.0, 0.0422, 5)
    timing = timing_of(LOOP.chain, LOOP.law)
    theirs, ours = (
        gain_limit(SENSOR, SCENARIO.admittance, timing, distance=distance, plant=plant) for plant in (OWN[0], OURS[0])
    )
    assert theirs.strongest == pytest.approx(ours.strongest, rel=1e-9)
    assert theirs.damping.is_certified


@pytest.mark.slow
def test_a_gain_is_designed_and_judged_with_them_and_pages_name_them(tmp_path: Path) -> None:
    found = verdict(LOOP, runs=8, changes=False)
    write_report(found, tmp_path / "page.html")
    words = (tmp_path / "page.html").read_text(encoding="utf-8")
    for said in ("a motor behind a gear", "pitch radius", "100 mm", "Felt", "the same at any depth"):
        assert said in words
    quiet = replace(LOOP, chain=replace(LOOP.chain, noise=0.0, relative_noise=0.0))
    design = pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, evaluate=quiet))
    assert BOUNDS[0] < design.gain < BOUNDS[1]


class Short(Geared):
    """One that forgets its friction."""

    def coefficients(self) -> tuple[float, ...]:
        return Geared.coefficients(self)[:6]


class Endless(Felt):
    """One without a thickness."""

    def numbers(self) -> Any:
        return math.inf, *Felt.numbers(self)[1:]


class Massless(Geared):
    """One that follows as it is told."""

    def coefficients(self) -> tuple[float, ...]:
        return (0.0,) * 8


@pytest.mark.parametrize(
    ("changed", "fields"),
    [
        ({"plant": Short(inertia=2e-2, pitch=0.1)}, {"argument": "Short"}),
        ({"contact": Endless(modulus=6e5, thickness=2e-3)}, {"argument": "Endless"}),
        ({"plant": Massless(inertia=2e-2, pitch=0.1)}, {"argument": "contact"}),
    ],
    ids=["numbers that are missing", "a number that is none", "no mass"],
)
def test_what_is_missing_is_said(changed: Any, fields: dict[str, Any]) -> None:
    with refused(**fields):
        replace(LOOP, **changed).run(SCENARIO, SENSOR, -0.6)


@pytest.mark.parametrize("model", [PlantModel, ContactModel])
def test_a_class_that_gives_no_numbers_is_none(model: Any) -> None:
    with pytest.raises(TypeError, match="abstract"):
        type("Empty", (model,), {})()


@pytest.mark.parametrize(("section", "kind", "known"), [("robot", "geared", "impedance"), ("contact", "felt", "hunt")])
def test_a_file_says_which_kinds_it_knows(section: str, kind: str, known: str, tmp_path: Path) -> None:
    text = (ROOT / "examples" / "loop.toml").read_text(encoding="utf-8")
    before, _, after = text.partition(f"[{section}]\nkind = ")
    path = tmp_path / "loop.toml"
    path.write_text(f'{before}[{section}]\nkind = "{kind}"\n{after.partition(chr(10))[2]}', encoding="utf-8")
    with pytest.raises(pt.errors.ScenarioFileError, match=rf"{section}.kind: found .*{kind}.*{known}"):
        pt.load_scenario(path)


def matrices(servo: bool) -> StateSpacePlant:
    """An impedance controller of 4 kN/m and 180 N s/m on 2 kg with feedforward; its force may lag at 80 Hz."""
    if not servo:
        rows = [[0.0, 1.0], [-2000.0, -90.0]], [[0.0] * 4, [2000.0, 90.0, 1.0, 0.5]]
        return StateSpacePlant(states=("position", "velocity"), a=rows[0], b=rows[1], c=[1.0, 0.0])
    rate = 2 * math.pi * 80
    return StateSpacePlant(
        states=("force", "velocity", "position"),
        a=[[-rate, -180 * rate, -4000 * rate], [0.5, 0.0, 0.0], [0.0, 1.0, 0.0]],
        b=[[4000 * rate, 180 * rate, 2 * rate, 0.0], [0.0, 0.0, 0.0, 0.5], [0.0] * 4],
        c=[0.0, 0.0, 1.0],
    )


@dataclass(frozen=True, kw_only=True)
class FlexibleJoint(LinearPlant):
    """A motor of 1 kg under an impedance controller, and a link of 1 kg behind an elastic joint."""

    kind: ClassVar[str] = "flexible-joint"

    stiffness: float = quantity("N/m", sign="positive", example='"20 kN/m"')

    def system(self) -> StateSpace:
        k, d, loss = 4000.0, 180.0, 10.0
        joint = [self.stiffness, loss, -self.stiffness, -loss]
        motor = [-k - self.stiffness, -d - loss, self.stiffness, loss]
        return StateSpace(
            states=("motor position", "motor velocity", "link position", "link velocity"),
            a=[[0.0, 1.0, 0.0, 0.0], motor, [0.0, 0.0, 0.0, 1.0], joint],
            b=[[0.0] * 4, [k, d, 2.0, 0.0], [0.0] * 4, [0.0, 0.0, 0.0, 1.0]],
            c=[0.0, 0.0, 1.0, 0.0],
        )


@pytest.mark.parametrize("servo", [False, True], ids=["two states", "three states"])
def test_matrices_give_what_coefficients_give(servo: bool) -> None:
    """Steps of 1 ms are a twentieth of the fastest time scale: Runge and Kutta's error of a step is 1e-7 of it."""
    own = matrices(servo)
    same = ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0, bandwidth=80.0 if servo else math.inf)
    assert own.coefficients()[0] == pytest.approx(2.0, rel=1e-12)
    ours, theirs = (replace(LOOP, plant=p, contact=OURS[1]).run(MANY, SENSOR, -0.6, runs=2) for p in (own, same))
    for name in ("time", "relative_velocity", "largest_excursion", "peak_force", "impulse", "rebound_velocity"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), rtol=1e-5, err_msg=name)
    limits = [
        gain_limit(SENSOR, SCENARIO.admittance, timing_of(LOOP.chain, LOOP.law), distance=0.0, plant=p)
        for p in (own, same)
    ]
    assert limits[0].strongest == pytest.approx(limits[1].strongest, rel=1e-8)
    assert limits[0].damping.is_certified


def test_more_states_move_as_their_equations_say() -> None:
    """Against SciPy's integrator, along the same virtual object: a cubic in each period, with its mean acceleration."""
    plant = FlexibleJoint(stiffness=5e3)
    trace = replace(NOISY, plant=plant).run(SCENARIO, SENSOR, -0.6, runs=1).trace(0)
    virtual = CubicHermiteSpline(trace.time, trace.virtual_position, trace.virtual_velocity)
    acceleration = np.diff(trace.virtual_velocity) / np.diff(trace.time)
    a, b, c = plant.system().arrays
    states = np.zeros(4)
    for k, (start, end) in enumerate(pairwise(trace.time)):

        def slopes(t: float, w: np.ndarray, rate: float = acceleration[k]) -> np.ndarray:
            return a @ w + b @ [virtual(t), virtual(t, 1), rate, 0.0]

        states = solve_ivp(slopes, (start, end), states, method="DOP853", rtol=1e-10, atol=1e-14).y[:, -1]
    # a step is a seventh of the fastest time scale, so its relative error is below (1 / 7)^5 / 120, some 1e-6
    assert c @ states == pytest.approx(trace.position[-1], rel=1e-5)
    assert abs(trace.position[-1] - trace.virtual_position[-1]) > 1e-3 * abs(trace.position[-1])


@pytest.mark.slow
def test_a_soft_joint_lowers_the_stability_limit_and_a_verdict_says_so(tmp_path: Path) -> None:
    timing = timing_of(NOISY.chain, NOISY.law)
    limits = [
        gain_limit(SENSOR, SCENARIO.admittance, timing, distance=0.0, plant=FlexibleJoint(stiffness=k)).strongest
        for k in (1e6, 5e3)
    ]
    assert abs(limits[1]) < abs(limits[0])
    found = verdict(replace(NOISY, plant=FlexibleJoint(stiffness=5e3), contact=OURS[1]), gain=-0.6, runs=8)
    assert found.stability.strongest == pytest.approx(limits[1], rel=1e-6)
    assert pickle.loads(pickle.dumps(found)).status is found.status  # noqa: S301 - our own
    page = write_report(found, tmp_path / "page.html").read_text(encoding="utf-8")
    assert "FlexibleJoint: a linear state space" in page
    assert "motor position, motor velocity, link position, link velocity" in page


@pytest.mark.parametrize(
    ("changed", "fields"),
    [
        ({"c": [1.0, 0.0, 0.0]}, {"argument": "c"}),
        (
            {"b": [[1.0, 0.0, 0.0, 0.0], [2000.0, 90.0, 1.0, 0.5]]},
            {"argument": "b"},
        ),
        ({"b": [[0.0] * 4, [2000.0, 90.0, 1.0, -0.5]]}, {"argument": "b"}),
        (
            {"b": [[0.0] * 4, [1000.0, 90.0, 1.0, 0.5]]},
            {"argument": "a"},
        ),
        ({"b": [[0.0] * 4, [2000.0, 90.0, 1.0, math.nan]]}, {"argument": "b"}),
        ({"states": ("x",)}, {"argument": "states", "value": 1}),
    ],
)
def test_matrices_that_are_no_robot_are_refused(changed: Any, fields: dict[str, Any]) -> None:
    with refused(**fields):
        replace(matrices(servo=False), **changed)


INSTALLED = f"""
from dataclasses import dataclass
from typing import ClassVar
from pretouch.fields import quantity
from pretouch.simulation import LinearPlant, StateSpace

{inspect.getsource(FlexibleJoint)}
"""


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["simulate", "verify"])
def test_a_file_takes_that_of_an_installed_package(verb, tmp_path, monkeypatch, capsys):
    entries = {"pretouch.plants": {"flexible-joint": "joints:FlexibleJoint"}}
    install(tmp_path / "site", monkeypatch, "joints", INSTALLED, entries)
    text = (ROOT / "examples" / "loop.toml").read_text(encoding="utf-8").replace("runs = 500", "runs = 8")
    text = text.replace("[controller]\n", '[controller]\ngain = "-0.5 N*s"\n')
    before, _, after = text.partition("[robot]\n")
    robot = '[robot]\nkind = "flexible-joint"\nstiffness = "20 kN/m"\n[contact]'
    file = before + robot + after.partition("[contact]")[2]
    (tmp_path / "loop.toml").write_text(file, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    run = command(monkeypatch, capsys)
    code, out, err = run(verb, "loop.toml", "--json", "--output", "page.html")
    assert code in {0, 1}, err
    assert strict(out)["status"] != "error"
    assert "a linear state space" in (tmp_path / "page.html").read_text(encoding="utf-8")
