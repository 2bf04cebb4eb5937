"""A batch is solved by fast paths that prove what they find: it is what the guaranteed path gives, run by run."""

from __future__ import annotations

import subprocess
import sys
import tracemalloc

import numpy as np
import pytest

from encounters import KINDS, random_encounters
from pretouch.motion import Admittance, ContactResult, Obstacle, Scenario, fast_path, find_contact
from pretouch.motion.request import make_request
from pretouch.motion.solution import Solution
from pretouch.sensors import ExponentialFirstOrder, ExponentialSecondOrder, InversePower, SensorModel

SENSORS: dict[str, SensorModel] = {
    "exponential-1": ExponentialFirstOrder(scale=0.458, rate=-61.0),
    "inverse-power": InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
    "exponential-2": ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["exponential-1", "inverse-power"])
def test_a_batch_is_what_the_guaranteed_path_gives(kind: str, name: str) -> None:
    batch = random_encounters(kind, 400, seed=11)
    found = find_contact(batch.scenario, SENSORS[name], batch.gain, horizon=20.0)
    request = make_request(batch.scenario, SENSORS[name], batch.gain, "auto", 20.0)
    sure = ContactResult(Solution(request, whole=True), request.method)
    assert (found.status == sure.status).all()
    time = np.asarray(sure.end.time)
    # contacts are promised to 1e-9 of their time; what changes by l', l'' and so on over that time follows
    assert np.allclose(found.end.time, time, rtol=1e-9, atol=0)
    for field in ("position", "velocity", "relative_velocity", "displacement"):
        mine, theirs = getattr(found.end, field), getattr(sure.end, field)
        rate = np.abs(sure.end.velocity) + np.abs(sure.end.acceleration) * (1 if field.endswith("y") else 0) + 1
        assert (
            np.abs(mine - theirs) <= 1e-8 * (np.abs(theirs) + rate * time + np.abs(sure.end.relative_velocity))
        ).all()
    assert np.array_equal(found.end.largest_excursion, sure.end.largest_excursion), "the whole motion is followed"
    assert np.array_equal(found.closest_distance, sure.closest_distance)


def test_a_batch_certifies_itself() -> None:
    """The impulse balance of contacts that the lanes found, from the sensor's own ln xi."""
    rng = np.random.default_rng(5)
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.0422, velocity=-rng.uniform(0.05, 1.0, 3000)),
    )
    for name, sensor in SENSORS.items():
        found = find_contact(scenario, sensor, -rng.uniform(0.05, 2.0, 3000))
        assert found.reached.all(), name
        assert found.impulse_residual.max() < 1e-9, name


@pytest.mark.parametrize("name", ["exponential-1", "inverse-power"])
def test_memory_is_that_of_input_and_output(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside them: one copy of the gains, which keeps a later reading true, and blocks of a fixed size."""
    monkeypatch.setattr(fast_path, "_KEPT", 1000)
    monkeypatch.setattr(fast_path, "_MOST", 10_000)
    n = 200_000
    rng = np.random.default_rng(6)
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=Obstacle(position=0.0422, velocity=-rng.uniform(0.05, 1.0, n)),
    )
    gain = -rng.uniform(0.05, 2.0, n)
    find_contact(scenario, SENSORS[name], gain)  # compiles
    tracemalloc.start()
    found = find_contact(scenario, SENSORS[name], gain)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    output = 9 * n
    blocks = 4 * 48 * 10_000 + 200_000
    assert found.end.time.nbytes + found.status.nbytes == output
    assert peak <= output + gain.nbytes + blocks + n, "a truth value per encounter is made on the way"


def test_no_mixture_of_inputs_compiles_a_kernel_again() -> None:
    """Numba compiles for each type of array, and a read-only one is a type of its own."""
    code = """
import numpy as np, pretouch as pt
from pretouch.motion.kernels import linear, linear_block, linear_block_states, series, series_block
many, sensors = np.linspace(1.0, 2.0, 20), (
    pt.ExponentialFirstOrder(scale=0.458, rate=-61.0),
    pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
)
mixtures = ((1.0, many, -many), (1.0, 1.0, -many), (many, 1.0, -0.5), (many, many, -0.5), (1.0, 1.0, -0.5))
for mass, speed, gain in mixtures:
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=mass, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=0.0422, velocity=-0.3 * speed),
    )
    for sensor in sensors:
        end = pt.find_contact(scenario, sensor, gain).end
        end.position, end.largest_excursion
kernels = (
    linear.solve_linear, linear_block.contact_times, linear_block_states.contact_states,
    series.solve_series, series_block.contact_times,
)
print([len(kernel.signatures) for kernel in kernels])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[1, 1, 1, 1, 1]\n"
