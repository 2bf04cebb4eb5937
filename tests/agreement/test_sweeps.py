"""A sweep is what the verbs give element by element, and the same whatever its blocks are."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.motion import parallel
from sweep_samples import CONSTANT, CURVED, OBJECTIVE, RESULTS, SCENARIO, cut_small

xr = pytest.importorskip("xarray", reason="needs the extra 'sweep'")

# contacts are exact to 1e-9; a motion's largest values and the series behind them to the same
CLOSE = 1e-9
# both searches end on the same flat minimum: 1e-13 of the objective is 1e-7 of the gain at worst
GAIN = 1e-7


def admittance(**changed: float) -> pt.Admittance:
    return replace(SCENARIO.admittance, **changed)


@pytest.mark.parametrize("sensor", [CONSTANT, CURVED], ids=lambda s: s.name)
def test_every_contact_is_the_one_of_its_encounter(sensor: pt.sensors.SensorModel) -> None:
    axes = {
        "obstacle.velocity": [-0.6, -0.3, 0.1],
        "admittance.stiffness": [0.0, 25.0],
        "gain": [-1.0, -0.3],
        "reference.velocity": [-0.05, 0.0],
    }
    names = ("time", "relative_velocity", "position", "largest_excursion", "closest_distance", "virtual_force")
    found = pt.sweep(pt.Task(SCENARIO, sensor, horizon=5.0), axes, results=names)
    assert found.sizes == {name: len(values) for name, values in axes.items()}
    for index, (v, stiffness, gain, drift) in zip(
        np.ndindex(*found["status"].shape), product(*axes.values()), strict=True
    ):
        scenario = pt.Scenario(
            admittance=admittance(stiffness=stiffness),
            obstacle=replace(SCENARIO.obstacle, velocity=v),
            reference=pt.Reference(velocity=drift),
        )
        one = pt.find_contact(scenario, sensor, gain, horizon=5.0)
        here = {name: float(found[name].values[index]) for name in names}
        assert found["status"].values[index] == one.status
        assert here["closest_distance"] == pytest.approx(one.closest_distance, rel=CLOSE, abs=1e-15)
        for name in set(names) - {"closest_distance"}:
            wanted = getattr(one.end, name) if one.reached else np.nan
            assert here[name] == pytest.approx(wanted, rel=CLOSE, nan_ok=True), (name, index)
    assert set(np.unique(found["status"])) > {0}, "some of them never touch"


def test_what_the_solver_takes_once_may_be_an_axis_too() -> None:
    """A parameter of the curve, how far it is recessed, and a property of the impact."""
    sensor = pt.Recessed(sensor=CURVED, recess=0.01)
    impact = pt.SpringImpact(robot_mass=4.0, obstacle_mass=1.0, stiffness=1e4)
    axes = {
        "sensor.exponent": [3.0, 3.5],
        "gain": [-0.8, -0.4],
        "sensor.recess": [0.0, 0.02],
        "impact.robot_mass": [1, 3],
    }
    found = pt.sweep(pt.Task(SCENARIO, sensor, impact=impact), axes, results=["impact_force", "time"])
    for index, (exponent, gain, recess, mass) in zip(
        np.ndindex(*found["time"].shape), product(*axes.values()), strict=True
    ):
        other = pt.Recessed(sensor=replace(CURVED, exponent=exponent), recess=recess)
        contact = pt.find_contact(SCENARIO, other, gain).contact
        force = replace(impact, robot_mass=mass).peak_force(contact.relative_velocity)
        assert found["time"].values[index] == pytest.approx(contact.time, rel=CLOSE)
        assert found["impact_force"].values[index] == pytest.approx(force, rel=CLOSE)


def test_inputs_side_by_side_are_one_axis() -> None:
    rng = np.random.default_rng(7)
    sample = {
        "obstacle.velocity": -rng.uniform(0.1, 0.5, 6),
        "obstacle.position": rng.uniform(0.03, 0.05, 6),
        "sensor.exponent": rng.uniform(3.0, 3.6, 6),
    }
    found = pt.sweep(pt.Task(SCENARIO, CURVED), {"sample": sample, "gain": [-0.7, -0.5]}, results=["time"], seed=7)
    for i, (v, p, n) in enumerate(zip(*sample.values(), strict=True)):
        scenario = replace(SCENARIO, obstacle=pt.Obstacle(position=p, velocity=v))
        for k, gain in enumerate((-0.7, -0.5)):
            time = pt.find_contact(scenario, replace(CURVED, exponent=n), gain).contact.time
            assert found["time"].values[i, k] == pytest.approx(time, rel=CLOSE)


def test_a_natural_frequency_holds_damping_ratio_and_mass() -> None:
    axes = {"admittance.natural_frequency": [3.0, 8.0], "admittance.mass": [0.5, 2.0]}
    found = pt.sweep(pt.Task(SCENARIO, CONSTANT, gain=-0.5), axes, results=["time"])
    for i, omega in enumerate(axes["admittance.natural_frequency"]):
        for k, mass in enumerate(axes["admittance.mass"]):
            same = pt.Admittance.from_natural_frequency(mass=mass, natural_frequency=omega, damping_ratio=1.0)
            time = pt.find_contact(replace(SCENARIO, admittance=same), CONSTANT, -0.5).contact.time
            assert found["time"].values[i, k] == pytest.approx(time, rel=CLOSE)


FOLLOWING = pt.excursion_objective(position_scale=0.5, velocity_scale="obstacle speed")


@pytest.mark.parametrize(
    ("objective", "speeds", "robot"),
    [(OBJECTIVE, [-0.3, 0.0], 0.2), (OBJECTIVE, [0.0], 0.3), (FOLLOWING, [-0.4, -0.1], 0.0)],
    ids=["some at rest", "at rest", "a scale that follows the speed"],
)
def test_designs_for_an_object_at_rest_or_with_a_scale_that_follows_are_made(
    objective: pt.Objective, speeds: list[float], robot: float
) -> None:
    """Each of the two is refused together with the other alone."""
    scenario = replace(SCENARIO, plant=pt.Plant(velocity=robot), reference=pt.Reference(velocity=robot))
    found = pt.sweep(pt.Task(scenario, CURVED, objective, bounds=(-10.0, -0.01)), {"obstacle.velocity": speeds})
    for i, speed in enumerate(speeds):
        one = replace(scenario, obstacle=replace(scenario.obstacle, velocity=speed))
        alone = pt.design(pt.Task(one, CURVED, objective, bounds=(-10.0, -0.01)))
        assert alone.gain is not None
        assert found["gain"].values[i] == pytest.approx(alone.gain, rel=GAIN)


@pytest.mark.parametrize("sensor", [CONSTANT, CURVED], ids=lambda s: s.name)
def test_every_design_is_the_one_of_its_encounter(sensor: pt.sensors.SensorModel) -> None:
    """Optimal, infeasible and without contact; over an input, a limit and a weight."""
    axes: dict[str, Any] = {
        "obstacle.velocity": [-3.0, -0.3, 0.3],
        "constraint.relative_velocity": [0.1, 0.5],
        "objective.displacement.weight": [1.0, 4.0],
    }
    options: dict[str, Any] = {"bounds": (-2.0, -0.01), "horizon": 5.0}
    limits = [pt.Constraint(name="relative_velocity", limit=1.0)]
    names = ("gain", "objective", "time")
    found = pt.sweep(pt.Task(SCENARIO, sensor, objective=OBJECTIVE, constraints=limits, **options), axes, results=names)
    words = found["status"].attrs["flag_meanings"].split()
    seen = set()
    for index, (v, limit, weight) in zip(np.ndindex(*found["gain"].shape), product(*axes.values()), strict=True):
        objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3, position_weight=weight)
        scenario = replace(SCENARIO, obstacle=replace(SCENARIO.obstacle, velocity=v))
        limited = [pt.Constraint(name="relative_velocity", limit=limit)]
        one = pt.design(pt.Task(scenario, sensor, objective, constraints=limited, **options))
        seen.add(one.status.value)
        assert words[int(found["status"].values[index])] == one.status.value
        gain, time = (one.gain, one.result.contact.time) if one.result else (np.nan, np.nan)
        value = np.nan if one.objective is None else one.objective
        assert found["gain"].values[index] == pytest.approx(gain, rel=GAIN, nan_ok=True)
        assert found["objective"].values[index] == pytest.approx(value, rel=1e-10, nan_ok=True)
        assert found["time"].values[index] == pytest.approx(time, rel=GAIN, nan_ok=True)
    assert seen == {"optimal", "infeasible", "no-contact"}


@pytest.mark.parametrize("sensor", [CONSTANT, CURVED], ids=lambda s: s.name)
def test_numbers_do_not_depend_on_blocks_threads_or_store(
    sensor: pt.sensors.SensorModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the last bit: what one call of the solver computes is fixed by the plan."""
    pytest.importorskip("zarr")
    axes = {"obstacle.velocity": np.linspace(-1.0, -0.05, 40), "gain": np.linspace(-2.0, -0.05, 1000)}
    found = []
    for i, (chunks, cores) in enumerate([(1, 1), (1, 3), (3, 2), (10, 1)]):
        cut_small(monkeypatch.setattr, encounters=4000, chunks=chunks)
        monkeypatch.setattr(parallel, "_cores", lambda cores=cores: cores)
        found.append(pt.sweep(pt.Task(SCENARIO, sensor), axes, results=RESULTS[:2]))
        found.append(
            pt.sweep(pt.Task(SCENARIO, sensor), axes, results=RESULTS[:2], output=tmp_path / f"{i}.zarr").load()
        )
    for other in found[1:]:
        xr.testing.assert_identical(found[0], other)


def test_work_without_a_compiled_solver_has_small_chunks() -> None:
    """A chunk, which a kill may lose, takes about a second: 16 designs of 50 ms, or 2,048 contacts of 0.5 ms."""
    from pretouch.sweeps.plan import make_plan

    course = (pt.motion.Stretch(until=0.05),)
    scenes = {False: SCENARIO, True: replace(SCENARIO, obstacle=replace(SCENARIO.obstacle, course=course))}
    axes = {"admittance.mass": np.linspace(0.8, 1.2, 500), "obstacle.velocity": np.linspace(-0.5, -0.1, 500)}

    def chunk(*, course: bool = False, **options: Any) -> int:
        plan = make_plan(pt.Task(scenes[course], CURVED, **options), axes, results=["relative_velocity"])
        return int(np.prod(plan.chunk))

    design: dict[str, Any] = {"objective": OBJECTIVE, "bounds": (-10.0, -0.01)}
    limits = (pt.Constraint(name="excursion", limit=0.1),)
    assert chunk(**design) >= chunk(**design, constraints=limits) > 1000
    assert chunk(**design, course=True) <= 16
    assert chunk(objective=OBJECTIVE, bounds=(1e-4, 0.05), law="virtual-drag") <= 16
    assert chunk(gain=-0.7) == 250_000
    assert chunk(gain=-0.7, course=True) <= 2048


@pytest.mark.parametrize("shape", [(7,), (100, 3), (3, 100), (5, 4, 3), (1, 1), (50, 7, 2)])
@pytest.mark.parametrize("most", [1, 10, 64, 10_000])
def test_chunks_cover_the_grid_once(shape: tuple[int, ...], most: int) -> None:

    from pretouch.sweeps.plan import make_plan

    names = ("obstacle.velocity", "plant.velocity", "reference.velocity")
    axes = {name: np.linspace(-1.0, -0.1, n) for name, n in zip(names, shape, strict=False)}
    plan = make_plan(pt.Task(SCENARIO, CONSTANT, gain=-0.5), axes, results=["time"], chunk_size=most)
    count = np.zeros(shape, dtype=int)
    for i in range(plan.chunk_count):
        count[plan.region(i)] += 1
        assert count[plan.region(i)].size <= most
    assert (count == 1).all()
    assert plan.chunk_count <= 2 * max(1, count.size // most) * len(shape) + 2 * shape[0], "few that are large"
    assert plan.thinned(most).size <= most
