"""The kernel variants of all supported processors agree within the rounding of fused operations."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

PROGRAM = """
import sys
import numpy as np
import pretouch as pt
from pretouch._core import native

rng = np.random.default_rng(14)
n = 403  # no multiple of any register
scenario = pt.Scenario(
    admittance=pt.Admittance(
        mass=rng.uniform(0.5, 2, n), damping=rng.uniform(5, 30, n), stiffness=rng.uniform(0, 30, n)
    ),
    obstacle=pt.Obstacle(position=rng.uniform(0.02, 0.08, n), velocity=-rng.uniform(0.05, 1, n)),
)
gain = -rng.uniform(0.05, 2, n)
curves = {
    "constant": pt.ExponentialFirstOrder(scale=1.0, rate=-60.0),
    "power": pt.InversePower(scale=1.3e-5, distance_offset=0.0419, exponent=3.32),
    "polynomial": pt.ExponentialSecondOrder(scale=1.0, rate=-70.0, curvature=150.0, maximum_distance=0.2),
}
OBJECTIVE = pt.excursion_objective(position_scale=0.05, velocity_scale=0.4)
found = {}
for name, sensor in curves.items():
    contact = pt.find_contact(scenario, sensor, gain)
    for quantity in ("time", "displacement", "relative_velocity", "largest_acceleration", "largest_excursion"):
        found[f"{name} {quantity}"] = getattr(contact.end, quantity)
    found[f"{name} status"] = contact.status
    found[f"{name} gradient"] = contact.gradients.of("relative_velocity", "gain")
    found[f"{name} design"] = pt.design(pt.Task(scenario, sensor, OBJECTIVE, bounds=(-10.0, -0.01))).gain
np.savez(sys.argv[1], variant=native.variant(), **found)
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    folder, found = tmp_path_factory.mktemp("variants"), {}
    for variant in ("base", "avx2", "avx512"):
        path = folder / f"{variant}.npz"
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, str(path)],
            env=os.environ | {"PRETOUCH_VARIANT": variant},
            capture_output=True,
            text=True,
            check=False,
        )
        if "which this processor does not support" in done.stderr:
            continue
        assert done.returncode == 0, done.stderr
        with np.load(path) as kept:
            found[variant] = dict(kept)
    return found


def test_each_variant_runs_as_itself(answers):
    assert "base" in answers
    for name, found in answers.items():
        assert str(found["variant"]) == name


def test_the_variants_find_the_same(answers):
    """What is proved is proved to 2e-11 of a time (closed form) or 1e-10 (any curve), and derivatives to 1e-8."""
    base, others = answers["base"], [found for name, found in answers.items() if name != "base"]
    if not others:
        pytest.skip("this processor has the base variant alone")
    for found in others:
        for name, numbers in base.items():
            if name == "variant":
                continue
            if name.endswith("status"):
                np.testing.assert_array_equal(found[name], numbers)
                continue
            kept = 1e-7 if "gradient" in name or "design" in name else 1e-9
            np.testing.assert_allclose(found[name], numbers, rtol=kept, atol=kept * np.abs(numbers).max(), err_msg=name)


def test_a_library_in_the_place_of_the_own_one_is_taken(tmp_path: Path):
    done = subprocess.run(
        [sys.executable, "-c", "from pretouch._core import native; native.kernel('best_variant')()"],
        env=os.environ | {"PRETOUCH_LIBRARY": str(tmp_path / "none.so")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "none.so" in done.stderr
    assert "is missing" in done.stderr
    assert f"in the folder {tmp_path}, set by PRETOUCH_LIBRARY" in done.stderr
