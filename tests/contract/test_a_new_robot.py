"""A robot or a contact of a user's own is one class in one place: it goes wherever those of pretouch go."""

from __future__ import annotations

import math
import pickle
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import pretouch as pt
from pretouch._core.blocks import Measured
from pretouch._core.fields import check_declared, quantity
from pretouch.report import write_report
from pretouch.simulation import ContactModel, ImpedancePlant, PlantModel, SpringDamper, gain_limit, timing_of
from verification_samples import BOUNDS, NOISY, OBJECTIVE, SCENARIO, SENSOR, verdict

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
    law = NOISY.law.with_gain(-0.6)
    theirs, ours = (
        pt.simulate(MANY, SENSOR, law, chain=NOISY.chain, runs=2, seed=3, plant=plant, contact=contact)
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


def test_a_gain_is_designed_and_judged_with_them_and_pages_name_them(tmp_path: Path) -> None:
    found = verdict(LOOP, runs=8, changes=False)
    write_report(found, tmp_path / "page.html")
    words = (tmp_path / "page.html").read_text(encoding="utf-8")
    for said in ("a motor behind a gear", "pitch radius", "100 mm", "Felt", "the same at any depth"):
        assert said in words
    quiet = replace(LOOP, chain=replace(LOOP.chain, noise=0.0, relative_noise=0.0))
    design = pt.design_gain(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, evaluate=quiet))
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
    ("changed", "words"),
    [
        ({"plant": Short(inertia=2e-2, pitch=0.1)}, r"Short: found \(.*\), expected 8 finite numbers: mass, stiffness"),
        ({"contact": Endless(modulus=6e5, thickness=2e-3)}, r"Endless: found \(inf, .*expected 5 finite numbers"),
        ({"plant": Massless(inertia=2e-2, pitch=0.1)}, "contact: an ideal plant has no mass"),
    ],
    ids=["numbers that are missing", "a number that is none", "no mass"],
)
def test_what_is_missing_is_said(changed: Any, words: str) -> None:
    with pytest.raises(pt.errors.InvalidInputError, match=words):
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
