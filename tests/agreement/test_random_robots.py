"""Random robots made of the parts of other people's models: masses against MuJoCo, and what their results say."""

from __future__ import annotations

import pytest

from random_scenes import mass_errors, random_scene, simulate_scene

pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")


def test_masses_and_recoil_are_those_of_small_pushes() -> None:
    """MuJoCo's own solver leaves errors up to 1e-7."""
    compared = 0
    for seed in range(24):
        errors = mass_errors(random_scene(seed))
        compared += bool(errors)
        assert max(errors.values(), default=0.0) < 1e-6, (seed, errors)
    assert compared > 20


@pytest.mark.slow(keep=4)
@pytest.mark.parametrize("seed", [3, 5, 11, 31, 9, 10, 23, 25, 27, 30, 41, 43, 47, 49, 54, 58])
def test_what_differs_from_the_prediction_is_said_with_its_cause(seed: int) -> None:
    outcome = simulate_scene(random_scene(seed))
    assert outcome.unsaid == ()
    assert max(outcome.differences.values()) > 0.1
