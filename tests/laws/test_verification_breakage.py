"""Sensors that fail: what the robot does is simulated, said in the verdict, and prevented by following the remedy."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch._core.blocks import PageTable
from pretouch._core.numbers import FloatArray
from pretouch.control import VirtualDamper
from pretouch.control.laws import release_for_noise
from pretouch.simulation import ClosedLoop
from pretouch.verification.at_rest import _largest
from pretouch.verification.breakage import Breakage, return_rate
from pretouch.verification.breakage_page import breakage_section
from verification_samples import loop_of, verdict

GAIN = -0.7463
# A weak signal at the start: a fall to the floor is plausible there, so that largest_rate alone does not suffice.
WEAK: dict[str, Any] = {"floor": 0.05}


def check(loop: ClosedLoop, **more: Any) -> pt.verification.Verdict:
    return verdict(loop, gain=GAIN, runs=8, changes=False, **more)


def breakage_of(found: pt.verification.Verdict) -> Breakage:
    assert found.breakage is not None
    return found.breakage


def followed(loop: ClosedLoop, remedy: str) -> ClosedLoop:
    """The loop after somebody has followed the remedy literally."""
    law: Any = loop.law
    if match := re.fullmatch(r"set largest_rate of the controller to ([\d.]+) 1/s", remedy):
        return replace(loop, law=replace(law, conditioning=replace(law.conditioning, largest_rate=float(match[1]))))
    match = re.fullmatch(r"set approach_only = true and release = ([\d.]+) in \[controller\]", remedy)
    assert match, remedy
    return replace(loop, law=replace(law, law=replace(law.law, approach_only=True, release=float(match[1]))))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "conditioning"),
    [(250.0, {}), (250.0, {"largest_rate": 500.0}), (60.0, WEAK)],
)
def test_the_remedy_of_a_failing_sensor_holds_when_it_is_followed(rate: float, conditioning: dict[str, Any]) -> None:
    loop = loop_of(rate=rate, noise=2e-4, conditioning=conditioning)
    found = check(loop)
    breakage = breakage_of(found)
    assert breakage.harder
    assert breakage.worst.increase > 0
    assert any(text.startswith(("PT404: ", "PT419: ")) and breakage.remedy in text for text in found.warnings)
    if found.status == "holds":
        assert not found.headline.startswith("Holds:")
    after = check(followed(loop, breakage.remedy))
    assert not breakage_of(after).harder
    assert not any(text.startswith(("PT404: ", "PT419: ")) for text in after.warnings)
    assert breakage_of(after).speed < breakage.speed


def test_the_speed_toward_the_object_stays_below_the_bound() -> None:
    for rate in (20.0, 60.0, 100.0, 170.0):
        breakage = breakage_of(check(loop_of(conditioning={"largest_rate": rate} | WEAK)))
        assert breakage.jump == pytest.approx(-GAIN * rate * (4e-3 + 4e-3) / 1.0)
        assert breakage.bound == pytest.approx(breakage.jump + breakage.return_rate * breakage.excursion)
        assert breakage.speed <= breakage.bound


@pytest.mark.parametrize("damping", [0.0, 1.0, 9.99, 10.0, 10.01, 40.0])
def test_no_force_away_from_the_object_makes_the_return_faster_than_its_bound(damping: float) -> None:
    admittance = pt.Admittance(mass=1.0, damping=damping, stiffness=25.0)
    step, rng = 1e-4, np.random.default_rng(3)
    fastest = []
    for forces in (np.zeros(20), *rng.uniform(0.0, 5.0, (4, 20)) * rng.integers(0, 2, (4, 20))):
        x, v, farthest, back = 0.1, 0.0, 0.1, 0.0
        for k in range(20_000):  # semi-implicit Euler: relative errors of about 5 rad/s times the step
            v += step * (forces[k // 1000] - damping * v - 25.0 * x)
            x += step * v
            farthest, back = max(farthest, abs(x)), max(back, -v if x > 0 else 0.0)
        fastest.append(back / farthest)
    assert max(fastest) <= return_rate(admittance) * (1 + 1e-3)
    assert fastest[0] == pytest.approx(return_rate(admittance), rel=1e-3)


def test_text_and_table_count_the_same_runs() -> None:
    """Without a force, the admittance returns to its reference, so that contact is harder than without mitigation."""
    breakage = breakage_of(check(loop_of(noise=2e-4, conditioning={"largest_rate": 500.0})))
    section = breakage_section(breakage)
    assert section is not None
    rows = next(block for block in section.blocks if isinstance(block, PageTable)).rows
    counts = [int(str(row[-1]).partition(" of ")[0]) for row in rows]
    assert sum(counts) == breakage.harder_than_unmitigated >= breakage.harder
    assert all(one.harder_than_unmitigated >= one.harder for one in breakage.results)
    assert (sum(counts) > 0) == (max(one.increase for one in breakage.results) > 0)
    assert sum(counts) > 0
    assert f"{sum(counts)} of {breakage.runs} runs" in breakage.text


def test_stuck_readings_are_the_motion_of_the_admittance_alone() -> None:
    breakage = breakage_of(check(loop_of(conditioning={"largest_rate": 60.0})))
    stuck = next(one for one in breakage.results if "stuck" in one.name)
    assert stuck.harder == 0
    assert stuck.speed == breakage.returning


def test_a_law_that_never_pulls_needs_no_remedy() -> None:
    loop = loop_of()
    only: Any = loop.law
    breakage = breakage_of(check(replace(loop, law=replace(only, law=VirtualDamper(gain=0.0, approach_only=True)))))
    assert (breakage.harder, breakage.remedy, breakage.jump) == (0, "", 0.0)
    assert breakage.speed <= breakage.bound


def test_the_speed_toward_the_object_is_that_of_the_trace() -> None:
    loop = loop_of()
    event = pt.simulation.Disturbance(kind="cable", distance=0.03)
    loop = replace(loop, chain=replace(loop.chain, disturbances=[event]))
    found = verdict(loop, gain=GAIN, runs=3, changes=False)
    result = found.mitigated
    assert result is not None
    for i in range(3):
        trace = result.trace(i)
        before = trace.velocity[trace.time <= result.time[i]]
        # the contact lies within a step, in which the robot still accelerates
        assert result.largest_advance[i] == pytest.approx(max(before.max(), result.velocity[i]), rel=1e-9)


def _at_rest(release: float | None, floor: float, noise: float) -> FloatArray:
    """The largest motion of a robot at rest, before an object at the edge of detection, in 5 s [m]."""
    own = {} if release is None else {"release": release}
    loop = loop_of(noise=noise, conditioning={"floor": floor})
    law: Any = loop.law
    loop = replace(loop, law=replace(law, law=VirtualDamper(gain=0.0, approach_only=True, **own)), horizon=5.0)
    sensor = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
    places = np.array([0.03, 0.0422, 0.06])
    admittance = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
    scenario = pt.Scenario(admittance=admittance, obstacle=pt.Obstacle(position=0.0422))
    task = pt.designs.Task(scenario, sensor, loop=loop, gain=GAIN)
    return _largest(task, GAIN, loop, places, 4)


def test_noise_is_no_ratchet_with_the_default_release() -> None:
    floor, noise = 0.01, 0.01 / 3
    assert _at_rest(0.0, floor, noise).max() > 0.1, "each rise of the noise counts, and no fall"
    assert _at_rest(None, floor, noise).max() < 0.04
    assert _at_rest(release_for_noise(floor, noise), floor, noise).max() < 0.04
