"""The page of the studio refuses what the command refuses, with the same sentence, and draws the same conclusions."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from page_core import PAGE, ROOT, built_core
from pretouch._core.units import unit_tables
from pretouch.designs import design_drag, design_gain
from pretouch.studio.field_rules import field_rules, largest_values

COUNT = 60
DAMPER: dict[str, Any] = {
    "sensor.model": "inverse-power",
    "sensor.scale": "1.30e-5",
    "sensor.distance_offset": "41.9 mm",
    "sensor.exponent": "3.32",
    "admittance.mass": "1 kg",
    "admittance.damping": "10 N*s/m",
    "admittance.stiffness": "25 N/m",
    "obstacle.position": "42.2 mm",
    "obstacle.velocity": "-0.3 m/s",
    "objective.kind": "excursion",
    "objective.position_scale": "0.5 m",
    "objective.velocity_scale": "0.3 m/s",
    "gain.bounds": ["-10 N*s", "-0.01 N*s"],
    "constraints.excursion": "0.2 m",
}
DRAG = {key: text for key, text in DAMPER.items() if not key.startswith(("gain.", "objective."))} | {
    "law.kind": "virtual-drag",
    "law.ratio": "0.15",
}
EXPONENTIAL = {key: text for key, text in DAMPER.items() if not key.startswith("sensor.")} | {
    "sensor.model": "exponential-1",
    "sensor.scale": "0.458",
    "sensor.rate": "-61 1/m",
}
UNITS = {
    **{"sensor.distance_offset": "m", "sensor.exponent": "", "sensor.recess": "m", "sensor.maximum_distance": "m"},
    **{"admittance.mass": "kg", "admittance.damping": "N*s/m", "admittance.stiffness": "N/m"},
    **{"obstacle.position": "m", "obstacle.velocity": "m/s", "obstacle.acceleration": "m/s^2"},
    **{"plant.position": "m", "plant.velocity": "m/s", "reference.velocity": "m/s", "sensor.rate": "1/m"},
    **{"objective.position_scale": "m", "objective.velocity_scale": "m/s", "law.ratio": ""},
    **{"constraints.excursion": "m", "constraints.relative_velocity": "m/s", "constraints.virtual_force": "N"},
}
NUMBERS = (
    "0",
    "-1",
    "1",
    "1e-3",
    "-1e-3",
    "0.5",
    "3",
    "1e4",
    "1e9",
    "-1e9",
    "1e80",
    "1e-80",
    "nan",
    "inf",
    "abc",
    "1,5",
)
KNOWN: list[dict[str, Any]] = [
    {**DRAG, "obstacle.velocity": "+0.3 m/s"},
    {**DRAG, "obstacle.velocity": "0 m/s"},
    {**DAMPER, "obstacle.velocity": "0.3 m/s"},
    {**DAMPER, "obstacle.acceleration": "5 m/s^2"},
    {**DRAG, "obstacle.acceleration": "5 m/s^2"},
    {**DRAG, "plant.velocity": "1 m/s"},
    {**DRAG, "law.ratio": "1.5"},
    {**DAMPER, "gain.bounds": ["-0.01 N*s", "-10 N*s"]},
    {**DAMPER, "gain.bounds": ["0.01 N*s", "10 N*s"]},
    {**DAMPER, "obstacle.position": "0 mm"},
    {**DAMPER, "obstacle.velocity": "3 kg"},
    {**DAMPER, "sensor.exponent": "1e6"},
    {**DAMPER, "admittance.stiffness": "1e12 N/m"},
    {**DAMPER, "sensor.maximum_distance": "10 mm"},
    {**DAMPER, "constraints.relative_velocity": "1 mm/s"},
    {**DAMPER, "obstacle.velocity": "0 m/s", "objective.velocity_scale": "obstacle speed"},
]


def drawn(seed: int, count: int) -> list[dict[str, Any]]:
    """Draw scenarios with one or two values that may make no sense."""
    random = np.random.default_rng(seed)
    requests = []
    for _ in range(count):
        fields = dict((DAMPER, DRAG, EXPONENTIAL)[random.integers(3)])
        possible = [
            key
            for key in UNITS
            if key in fields or key.split(".")[0] in {"constraints", "plant", "reference", "obstacle"}
        ]
        for key in random.choice(possible, size=random.integers(1, 3), replace=False):
            number, unit = NUMBERS[random.integers(len(NUMBERS))], UNITS[str(key)]
            fields[str(key)] = f"{number} {unit}".strip()
        requests.append(fields)
    return requests


def page(requests: list[dict[str, Any]]) -> list[dict[str, Any]]:
    if shutil.which("node") is None:
        pytest.skip("node is not installed")
    units = {**unit_tables(), "rules": field_rules(), "largest": largest_values()}
    command = ["node", ROOT / "tests/page/judge.mjs", built_core(), PAGE]
    text = json.dumps({"units": units, "requests": requests})
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    answers: list[dict[str, Any]] = json.loads(done.stdout)
    return answers


def command(toml: str, folder: Path) -> tuple[dict[str, str], str]:
    """Return the mistakes by key, and the conclusion."""
    path = folder / "s.toml"
    path.write_text(toml, encoding="utf-8")
    try:
        task = pt.load_scenario(path)
        if task.drag_effect is not None:
            return {}, "holds" if design_drag(task).holds else "fails"
        return {}, str(design_gain(task).status)
    except pt.errors.InvalidInputError as error:
        lines = re.findall(r"line \d+: ([\w.]+): (.*?)(?=\n|$)", str(error))
        return dict(lines) or {"": str(error)}, ""


def without_value(text: str) -> str:
    """Remove the value, which Python writes as the number and the page as it was typed."""
    return re.sub(r"^found \S+, ", "", text)


@pytest.mark.parametrize("kind", ["known", "drawn"])
def test_page_and_command_agree(kind: str, tmp_path: Path) -> None:
    requests = KNOWN if kind == "known" else drawn(1, COUNT)
    differences = []
    for fields, answer in zip(requests, page(requests), strict=True):
        mistakes, conclusion = command(answer["toml"], tmp_path)
        changed = {key: text for key, text in fields.items() if DAMPER.get(key) != text and DRAG.get(key) != text}
        shown = {key: without_value(text) for key, text in answer["mistakes"].items()}
        expected = {key: without_value(text) for key, text in mistakes.items()}
        found = answer.get("conclusion", "")
        # of several mistakes, the page may list only those that do not depend on the others
        same = shown.items() <= expected.items() and bool(shown) == bool(expected)
        if not same or found not in {conclusion, "uncertain"}:
            differences.append((changed, shown, expected, found, conclusion))
    assert differences == []
