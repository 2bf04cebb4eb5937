"""The same call gives the same bits: first thing in a process or last, on one core or two, whatever hashes are."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pretouch as pt
from encounters import CURVES, random_encounters
from pretouch._core.numbers import FloatArray
from pretouch.motion.scenario import map_fields
from repeated_calls import CALLS, F_1, loop, scene

SCRIPT = Path(__file__).parents[1] / "repeated_calls.py"


def told(order: str, cores: int, seed: int) -> dict[str, str]:
    threads = {name: str(cores) for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, str(SCRIPT), order, str(cores)],
        env=os.environ | threads | {"PYTHONHASHSEED": str(seed)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, str] = json.loads(done.stdout)
    return found


@pytest.fixture(scope="module")
def early() -> dict[str, str]:
    return told("early", 1, 0)


@pytest.fixture(scope="module")
def late() -> dict[str, str]:
    return told("late", 2, 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", CALLS)
def test_a_call_gives_the_same_bits_early_and_late_on_one_core_and_two(
    name: str, early: dict[str, str], late: dict[str, str]
) -> None:
    assert early[name] == late[name]


class Doubled(pt.InversePower):
    """A curve of somebody else's that holds more than it compares."""

    factor: float

    def _log_slope(self, distance: FloatArray) -> FloatArray:
        return self.factor * super()._log_slope(distance)

    def _log_output(self, distance: FloatArray) -> FloatArray:
        return self.factor * super()._log_output(distance)


def doubled(factor: float) -> Doubled:
    sensor = Doubled(scale=1.0, distance_offset=0.0419, exponent=3.32)
    object.__setattr__(sensor, "factor", factor)
    return sensor


@pytest.mark.parametrize("recess", [0.0, 0.002])
def test_a_curve_that_equals_another_is_not_taken_for_it(recess: float) -> None:
    """Whatever was asked of the other before: a factor of ln xi is one of the gain."""
    one, other = (
        pt.Recessed(sensor=doubled(factor), recess=recess) if recess else doubled(factor) for factor in (1, 2)
    )
    assert one == other
    for gains in (-0.4, np.linspace(-1.0, -0.1, 20)):
        first = pt.find_contact(scene(), one, 2 * np.asarray(gains)).end.time
        second = pt.find_contact(scene(), other, gains).end.time
        assert second == pytest.approx(first, rel=1e-9)  # the promise for times, on either side
        assert np.all(second != pt.find_contact(scene(), one, gains).end.time)
    designs = [pt.design(pt.Task(scene(), sensor, F_1, bounds=(-10.0, -1e-3))) for sensor in (one, other)]
    assert designs[0].gain == pytest.approx(2 * designs[1].gain, rel=1e-6)  # a flat optimum of objectives to 1e-12
    runs = [loop().run(scene(), sensor, gain) for sensor, gain in ((one, -0.8), (other, -0.8))]
    assert runs[0].relative_velocity != runs[1].relative_velocity


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("kind", ["letter", "accelerated", "everything"])
def test_neighbors_and_place_in_a_call_change_no_bit(curve: str, kind: str) -> None:
    """As long as the farthest starts lie between the same powers of two: so far a curve is approximated."""
    batch = random_encounters(kind, 80, seed=4)
    whole = pt.find_contact(batch.scenario, CURVES[curve], batch.gain, horizon=60.0)
    farthest = int(np.argmax(batch.scenario.distance))
    for which in (
        np.arange(80)[::-1],
        np.append(np.arange(20, 41), farthest),
        np.append(np.arange(0, 80, 3), farthest),
    ):
        some = map_fields(batch.scenario, lambda v, which=which: v[which] if np.ndim(v) else v)
        found = pt.find_contact(some, CURVES[curve], batch.gain[which], horizon=60.0)
        for name in pt.motion.ContactState.names():
            np.testing.assert_array_equal(getattr(found.end, name), getattr(whole.end, name)[which], err_msg=name)


@pytest.mark.parametrize("curve", CURVES)
def test_alone_an_encounter_has_the_time_that_it_has_among_others(curve: str) -> None:
    batch = random_encounters("everything", 60, seed=5)
    whole = pt.find_contact(batch.scenario, CURVES[curve], batch.gain, horizon=60.0)
    for i in range(60):
        one = map_fields(batch.scenario, lambda v, i=i: float(v[i]) if np.ndim(v) else v)
        alone = pt.find_contact(one, CURVES[curve], float(batch.gain[i]), horizon=60.0)
        assert alone.status == whole.status[i]
        assert alone.end.time == pytest.approx(whole.end.time[i], rel=1e-9)  # what is promised; some 1e-11 is found
