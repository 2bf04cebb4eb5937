"""A new built-in curve, plant, objective, term or distribution changes at most three files of the package."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from command_text import strict
from test_entry_points import EVERYTHING, OTHERS

import pretouch

FIELDS = """
from dataclasses import dataclass
import numpy as np
from pretouch._core.fields import INPUT, check_declared, quantity
"""


def source_of(name: str) -> str:
    """Return the class that an installed package provides in test_entry_points.py."""
    part = next(part for part in OTHERS.split("@dataclass") if f"class {name}" in part)
    return f"{FIELDS}\n\n@dataclass{part.partition('def plain')[0]}\n\n"


CURVE = "from pretouch.sensors.model import SensorModel, parameter\n" + source_of("TwoSources")
TERM = """"energy": Entry("energy of the robot", "E", "J", limit="energy", needs_impact=True),
    """
FORMULA = """"energy": lambda state, impact: 0.5 * impact.robot_mass * state.relative_velocity**2,
    """
Edits = dict[str, tuple[str, str]]
"""The text in front of which each file gets more text; a file without such a text is new."""

KINDS: dict[str, Edits] = {
    "curve": {
        "sensors/two_sources.py": ("", CURVE),
        "sensors/__init__.py": ("__all__ = [", "from .two_sources import TwoSources\n\n"),
    },
    "plant": {
        "simulation/robot.py": ("PLANT_KINDS: Final", source_of("Geared")),
        "simulation/robot.py#list": ("PositionPlant)}", "Geared, "),
    },
    "objective": {
        "designs/custom_objectives.py": ("OBJECTIVE_KINDS: Final", source_of("Comfort")),
        "designs/custom_objectives.py#list": ('"excursion": excursion_objective', '"comfort": Comfort, '),
    },
    "distribution": {
        "uncertainty/correlated.py": ("DISTRIBUTION_KINDS: Final", source_of("Triangular")),
        "uncertainty/correlated.py#list": ('"normal": Normal', '"triangular": Triangular, '),
    },
    "term": {
        "_core/vocabulary.py": ('"peak_force": Entry(', TERM),
        "designs/quantities.py": ('"impact_force": lambda', FORMULA),
    },
}
"""Files by path in the package; what follows a # tells two changes of a file apart."""

FILE = EVERYTHING.replace(
    "[verify]",
    """[constraints]
energy = "2 J"
[impact]
robot_mass = "4 kg"
stiffness = "10 kN/m"
[pareto]
quantities = ["displacement", "energy"]
[verify]""",
)


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Copy the package, add one built-in of each kind, and write a file that uses them."""
    folder = tmp_path_factory.mktemp("changed")
    package = folder / "site/pretouch"
    shutil.copytree(Path(pretouch.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    for edits in KINDS.values():
        for name, (place, more) in edits.items():
            path = package / name.partition("#")[0]
            text = path.read_text(encoding="utf-8") if place else ""
            assert text.count(place) == (1 if place else len(text) + 1), (name, place)
            path.write_text(text.replace(place, more + place) if place else more, encoding="utf-8")
    (folder / "kinds.toml").write_text(FILE, encoding="utf-8")
    return folder


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_changes_at_most_three_files(kind: str) -> None:
    assert len({name.partition("#")[0] for name in KINDS[kind]}) <= 3


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["design", "pareto", "robust", "simulate", "verify"])
def test_every_verb_takes_the_new_kinds(verb: str, changed: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(changed / "site")}
    command = [sys.executable, "-m", "pretouch", verb, "kinds.toml", "--json"]
    run = subprocess.run(command, cwd=changed, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode in {0, 1}, run.stderr
    assert strict(run.stdout)["status"] not in {"error", "infeasible"}
    words = {"design": "energy", "pareto": "energy", "robust": "Triangular", "simulate": "inertia", "verify": "energy"}
    assert words[verb] in run.stdout
