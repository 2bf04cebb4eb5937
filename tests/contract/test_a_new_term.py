"""A quantity of a contact is one value, from a user's file or an installed package: it goes wherever quantities go."""

from __future__ import annotations

import json
import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from command_text import command, strict

import pretouch as pt
import scenario_text
from installed import install
from pretouch._core.vocabulary import QUANTITIES
from pretouch.designs import CONSTRAINT_NAMES, QUANTITY_UNITS, ContactQuantity
from refusals import refused
from verification_samples import BOUNDS, NOISY, SCENARIO, SENSOR

pytestmark = pytest.mark.usefixtures("short_rest")

SOURCE = """
from pretouch.designs import ContactQuantity

def energy(state, impact):
    return 0.5 * impact.robot_mass * state.relative_velocity**2

ENERGY = ContactQuantity("energy", energy, unit="J", symbol="E", words="energy of the robot", needs_impact=True)
"""
MASS = 4.0
IMPACT = pt.SpringImpact(robot_mass=MASS, stiffness=1e4)
SPEED = {"obstacle.velocity": pt.uncertainty.Uniform(low=-0.35, high=-0.25)}
TERMS = """\
kind = "custom"
terms = [{ quantity = "displacement", scale = "0.5 m" }, { quantity = "energy", scale = "0.1 J" }]
"""
REST = """\
energy = "12 mJ"
[impact]
robot_mass = "4 kg"
stiffness = "10 kN/m"
[pareto]
quantities = ["displacement", "energy"]
[uncertainty]
obstacle.velocity = { uniform = ["-0.3 m/s", "-0.28 m/s"] }
[robust]
samples = 16
validation = 16
required = { energy = 0.5 }
[chain]
rate = "250 Hz"
noise = 1e-3
[controller]
rate = "1 kHz"
[verify]
runs = 12
"""
EXCURSION = 'kind = "excursion"\nposition_scale = "0.5 m"\nvelocity_scale = "0.3 m/s"\n'
FILE = scenario_text.replaced(EXCURSION, TERMS, scenario_text.WHOLE + REST)


def energy(state: Any, impact: Any) -> Any:
    return 0.5 * impact.robot_mass * state.relative_velocity**2


def forget() -> None:
    for name in ("energy", "retreat"):
        for known in (QUANTITIES, QUANTITY_UNITS, CONSTRAINT_NAMES):
            known.pop(name, None)  # type: ignore[attr-defined]


@pytest.fixture
def quantity() -> Iterator[ContactQuantity]:
    yield ContactQuantity("energy", energy, unit="J", symbol="E", words="energy of the robot", needs_impact=True)
    forget()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    install(tmp_path / "site", monkeypatch, "energies", SOURCE, {"pretouch.terms": {"energy": "energies:ENERGY"}})
    monkeypatch.chdir(tmp_path)
    (tmp_path / "energy.toml").write_text(FILE, encoding="utf-8")
    yield tmp_path
    forget()


def task(*terms: pt.Term, **options: Any) -> pt.Task:
    return pt.Task(SCENARIO, SENSOR, pt.Objective(terms=terms), **{"bounds": BOUNDS, "impact": IMPACT, **options})


def test_a_design_with_it_is_that_with_the_square_of_the_speed(quantity: ContactQuantity) -> None:
    """A limit of 12 mJ of 4 kg is one of the speed; an optimum on a limit is known to 1e-9."""
    price = pt.Term(quantity="displacement", scale=0.5)
    limit = pt.Constraint(name=quantity, limit=0.012)
    own = pt.design(task(price, constraints=[limit]))
    speed = pt.Constraint(name="relative_velocity", limit=(2 * 0.012 / MASS) ** 0.5)
    assert own.gain == pytest.approx(pt.design(task(price, constraints=[speed])).gain, rel=1e-8)
    assert (own.constraints[0].unit, own.certificate.at) == ("J", "energy")
    again = pickle.loads(pickle.dumps(own))  # noqa: S301 - our own
    assert again == own
    with refused("energy"):
        pt.design(task(price, constraints=[limit], impact=None))


def test_another_process_knows_it(quantity: ContactQuantity) -> None:
    kept = pickle.dumps(task(pt.Term(quantity=quantity, scale=0.1)))
    forget()
    with refused("quantity", value="energy"):
        pt.Term(quantity="energy", scale=0.1)
    assert pt.design(pickle.loads(kept)).gain == BOUNDS[0]  # noqa: S301 - our own


@pytest.mark.slow
def test_it_is_shown_wherever_quantities_are(quantity: ContactQuantity, tmp_path: Path) -> None:
    both = pt.Term(quantity="displacement", scale=0.5), pt.Term(quantity=quantity, scale=0.1)
    asked = task(*both, constraints=[pt.Constraint(name="energy", limit=0.02)])
    answers = {
        "design": pt.design(asked),
        "front": pt.pareto(asked.replace(pareto=pt.designs.ParetoOptions(quantities=("displacement", quantity)))),
        "robust": pt.robust(
            asked.replace(uncertainty=SPEED, robust=pt.designs.RobustOptions(samples=16, validation=16))
        ),
        "admittance": pt.design(asked.replace(damping_ratio=(0.7, 1.3))),
        "verdict": pt.verify(asked.replace(loop=NOISY, verify=pt.designs.VerifyOptions(runs=12))),
    }
    for name, answer in answers.items():
        page = pt.write_report(answer, tmp_path / f"{name}.html").read_text(encoding="utf-8")
        assert "energy of the robot" in page, name
        assert "energy" in json.dumps(answer.to_dict(), default=str), name
    verdict = answers["verdict"]
    speed = abs(verdict.mitigated.relative_velocity).max()
    assert verdict.limits[0].value == pytest.approx(0.5 * MASS * speed**2, rel=1e-12)
    pytest.importorskip("xarray")
    swept = pt.sweep(asked, {"constraint.energy": [0.01, 0.02]}, results=["gain", "energy"])["energy"]
    assert swept.attrs == {"long_name": "energy of the robot, optimal gain", "units": "J"}
    assert swept.values[0] == pytest.approx(0.01, rel=1e-6)


def test_a_signed_one_is_not_taken_by_its_magnitude(quantity: ContactQuantity) -> None:
    """The farther the robot has retreated, the smaller x - x_d is: it is below every positive limit."""
    signed = ContactQuantity("retreat", lambda state, _: state.displacement, unit="m", is_magnitude=False)
    speed = pt.Term(quantity="relative_velocity", scale=0.3)
    free = pt.design(task(speed))
    assert pt.design(task(speed, constraints=[pt.Constraint(name=signed, limit=1e-6)])).gain == free.gain
    front = pt.pareto(task(speed, pareto=pt.designs.ParetoOptions(quantities=(signed, "relative_velocity"))))
    assert front.of("retreat").max() < 0  # both are best at the strongest gain
    assert front.gain.tolist() == pytest.approx([BOUNDS[0]])


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["design", "pareto", "robust", "verify", "sweep"])
def test_a_file_takes_that_of_an_installed_package(verb, folder, monkeypatch, capsys):
    run = command(monkeypatch, capsys)
    if verb == "sweep":
        pytest.importorskip("h5netcdf")
    options = ["--axis", "constraint.energy=10 mJ,20 mJ"] if verb == "sweep" else ["--output", "page.html"]
    code, out, err = run(verb, "energy.toml", "--json", *options)
    assert code in {0, 1}, err
    assert strict(out)["status"] not in {"error", "infeasible"}
    if verb != "sweep":
        assert "energy of the robot" in (folder / "page.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "fields"),
    [
        ('energy = "12 mJ"', 'energy = "12 N"', {"argument": "constraints.energy", "value": "12 N"}),
        ('energy = "12 mJ"', 'energi = "12 mJ"', {"argument": "constraints.energi", "value": "12 mJ"}),
        (
            'quantity = "energy"',
            'quantity = "power"',
            {"argument": "objective.terms[1].quantity", "value": "power"},
        ),
        (
            '[impact]\nrobot_mass = "4 kg"\nstiffness = "10 kN/m"\n',
            "",
            {"argument": "objective.terms[1].quantity", "value": "energy"},
        ),
    ],
)
def test_a_mistake_is_found_at_its_line(folder, old, new, fields):
    Path("energy.toml").write_text(scenario_text.replaced(old, new, FILE), encoding="utf-8")
    with refused(**fields, error=pt.errors.ScenarioFileError):
        pt.load_scenario("energy.toml")


@pytest.mark.parametrize("name", ["time", "gain", "two words"])
def test_a_name_that_is_taken_or_is_none_is_refused(name: str) -> None:
    with refused("name"):
        ContactQuantity(name, energy)
