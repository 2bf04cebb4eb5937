"""What a scenario file says of the sampled loop arrives in the objects that simulate it and limit its gain."""

from __future__ import annotations

import dataclasses
import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pretouch as pt
from pretouch.config import load_scenario
from pretouch.config.robot_section import ROBOT_MODEL
from pretouch.config.schema import keys_of
from pretouch.control import Conditioning, Controller, Limits, VirtualAdmittance, VirtualDamper
from pretouch.simulation import (
    ClosedLoop,
    HuntCrossley,
    IdealPlant,
    ImpedancePlant,
    PositionPlant,
    SensorChain,
    SpringDamper,
    chain_of_fit,
    gain_limit,
    sensor_part,
    timing_of,
)
from scenario_text import ENCOUNTER, SENSOR

ROOT = Path(__file__).parents[2]
SCENE = SENSOR.replace("1.30e-5", '"0.533 counts"') + ENCOUNTER
CHAIN, CONTROLLER = '[chain]\npart = "VCNL4010"\n', '[controller]\nrate = "1 kHz"\n'
# every key with a value that is no default
ALL_OF = {
    "chain": """\
part = "VCNL4040"
rate = "100 Hz"
phase = "1 ms"
exposure = "2 ms"
delay = "0.5 ms"
jitter = "0.1 ms"
noise = "12 counts"
relative_noise = "0.3 %"
misfit = "1 %"
misfit_length = "4 mm"
offset = "-5 counts"
crosstalk = "40 counts"
drift = "2 counts/s"
lowest = "-inf"
highest = "30000 counts"
resolution = "4 counts"
dropout = 0.01
measures_distance = true
distance_noise = "1 mm"
distance_resolution = "0.5 mm"
""",
    "controller": """\
period = "2 ms"
floor = "50 counts"
offset = "36 counts"
saturation = "29 000 counts"
median_window = 3
moving_average = 2
low_pass_order = 2
cutoff = "40 Hz"
timeout = "80 ms"
fade_time = "30 ms"
largest_rate = "200 1/s"
approach_only = true
release = 0.02
ramp_time = "5 ms"
largest_force = "60 N"
largest_speed = "1 m/s"
largest_acceleration = "50 m/s^2"
largest_excursion = "0.3 m"
contact_gain = 0.5
contact_threshold = "2 N"
gain = "-0.6 N*s"
""".replace("29 000", "29000"),
    "robot": """\
kind = "impedance"
mass = "4 kg"
stiffness = "4 kN/m"
damping = "250 N*s/m"
coulomb_friction = "1 N"
friction_speed = "2 mm/s"
feedforward = false
""",
    "contact": """\
kind = "hunt-crossley"
obstacle_mass = "3 kg"
stiffness = "30 N/mm^1.5"
exponent = 1.5
dissipation = "0.5 s/m"
""",
    "loop": 'seed = 7\nhorizon = "3 s"\nfollow_time = "0.1 s"\nstart_distance = "70 mm"\nstability_margin = 1.5\n',
    "verify": "runs = 20\nconfidence = 0.9\nspeed_tolerance = 0.2\n",
}
LOOP = ClosedLoop(
    chain=SensorChain(
        rate=100.0,
        phase=0.001,
        random_phase=False,
        exposure=0.002,
        delay=0.0005,
        jitter=0.0001,
        noise=12.0,
        relative_noise=0.003,
        misfit=0.01,
        misfit_length=0.004,
        offset=-5.0,
        crosstalk=40.0,
        drift=2.0,
        lowest=-math.inf,
        highest=30000.0,
        resolution=4.0,
        dropout=0.01,
        measures_distance=True,
        distance_noise=0.001,
        distance_resolution=0.0005,
    ),
    law=Controller(
        period=0.002,
        conditioning=Conditioning(
            floor=50.0,
            offset=36.0,
            saturation=29000.0,
            sensor_period=0.01,
            median_window=3,
            moving_average=2,
            low_pass_order=2,
            cutoff=40.0,
            timeout=0.08,
            fade_time=0.03,
            largest_rate=200.0,
        ),
        law=VirtualDamper(gain=-0.6, approach_only=True, release=0.02, ramp_time=0.005),
        admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        limits=Limits(force=60.0, speed=1.0, acceleration=50.0, excursion=0.3),
        contact_gain=0.5,
        contact_threshold=2.0,
    ),
    plant=ImpedancePlant(
        mass=4.0, stiffness=4000.0, damping=250.0, coulomb_friction=1.0, friction_speed=0.002, feedforward=False
    ),
    contact=HuntCrossley(obstacle_mass=3.0, stiffness=30.0 / 1e-3**1.5, dissipation=0.5, exponent=1.5),
    seed=7,
    horizon=3.0,
    follow_time=0.1,
    start_distance=0.07,
)


@pytest.fixture
def read(tmp_path):
    def load(text, encounter=SCENE):
        file = tmp_path / "loop.toml"
        file.write_text(encounter + text)
        return load_scenario(file)

    return load


def test_every_key_arrives_in_the_objects(read):
    asked = read("".join(f"[{name}]\n{text}" for name, text in ALL_OF.items()))
    assert asked.loop == LOOP
    assert (asked.gain, asked.sensor_part, asked.stability_margin) == (-0.6, sensor_part("VCNL4040"), 1.5)
    assert asked.verify == pt.designs.VerifyOptions(runs=20, confidence=0.9, speed_tolerance=0.2)


def test_the_texts_above_have_every_key():
    """Those that other variants take are tested below."""
    others = {
        "controller": {"rate"},
        "robot": {"bandwidth", "viscous_friction", "damping_ratio", *ROBOT_MODEL.keys},  # the model: test_robot_task
        "contact": {"damping"},
    }
    for name, text in ALL_OF.items():
        assert {line.split(" = ")[0] for line in text.splitlines()} == set(keys_of(name)) - others.get(name, set())


@pytest.mark.parametrize(
    ("text", "plant"),
    [
        ("", IdealPlant()),
        ('[robot]\nkind = "ideal"\n', IdealPlant()),
        (
            '[robot]\nkind = "impedance"\nmass = 2\nstiffness = 4e3\ndamping = 180\nbandwidth = "80 Hz"\n',
            ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0, bandwidth=80.0),
        ),
        (
            '[robot]\nkind = "impedance"\nmass = 2\nstiffness = 4e3\ndamping = 180\nviscous_friction = "3 N*s/m"\n',
            ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0, viscous_friction=3.0),
        ),
        (
            '[robot]\nkind = "position"\nmass = "2 kg"\nbandwidth = "20 Hz"\ndamping_ratio = 0.8\n',
            PositionPlant(mass=2.0, bandwidth=20.0, damping_ratio=0.8),
        ),
    ],
)
def test_every_kind_of_robot_is_built(read, text, plant):
    loop = read(CHAIN + CONTROLLER + text).loop
    assert loop.plant == plant
    assert loop.contact is None
    # a position-controlled robot does not feel a contact force, so the admittance has to
    assert loop.law.contact_gain == (1.0 if isinstance(plant, PositionPlant) else 0.0)


@pytest.mark.parametrize(
    ("text", "contact"),
    [
        (
            'kind = "spring-damper"\nstiffness = "10 N/mm"\ndamping = "5 N*s/m"\n',
            SpringDamper(stiffness=1e4, damping=5.0),
        ),
        (
            'kind = "hunt-crossley"\nstiffness = "1e4 N/m"\nexponent = 1\n',
            HuntCrossley(stiffness=1e4, exponent=1.0),
        ),
        ('kind = "hunt-crossley"\nstiffness = "2 MN/m^1.5"\n', HuntCrossley(stiffness=2e6)),
        ('kind = "hunt-crossley"\nstiffness = 2e6\nobstacle_mass = "inf"\n', HuntCrossley(stiffness=2e6)),
    ],
)
def test_every_kind_of_contact_is_built(read, text, contact):
    robot = '[robot]\nkind = "position"\nmass = "2 kg"\nbandwidth = "20 Hz"\n'
    assert read(CHAIN + CONTROLLER + robot + "[contact]\n" + text).loop.contact == contact


def test_a_part_is_taken_as_it_is_and_its_values_are_overridden(read):
    part = sensor_part("VCNL4010")
    assert read(CHAIN + CONTROLLER).loop.chain == dataclasses.replace(part.chain, random_phase=True)
    text = CHAIN + 'noise = "3 counts"\nphase = 0\n' + CONTROLLER
    assert read(text).loop.chain == dataclasses.replace(part.chain, noise=3.0)


def test_what_is_left_out_follows_from_the_chain(read):
    asked = read(CHAIN + 'offset = "100 counts"\ncrosstalk = "50 counts"\n' + CONTROLLER)
    law = asked.loop.law
    assert law.conditioning == Conditioning(floor=30.0, offset=150.0, saturation=65535.0, sensor_period=1 / 250.0)
    assert law.law == VirtualDamper(gain=0.0)
    assert law.limits == Limits()
    assert (asked.gain, asked.verify, asked.stability_margin) == (None, pt.designs.VerifyOptions(), None)
    # the defaults of the loop are written down twice, and must be the same
    bare = ClosedLoop(law=law, chain=asked.loop.chain)
    assert asked.loop == bare


def test_a_sensor_at_the_rate_of_the_controller_has_its_period(read):
    text = '[chain]\nrate = "300 Hz"\n[controller]\nrate = "300 Hz"\nfloor = "1 count"\n'
    loop = read(text).loop
    assert loop.law.conditioning.sensor_period == loop.law.period == 1 / 300.0
    assert loop.law.conditioning.saturation is None
    by_period = read(text.replace('[controller]\nrate = "300 Hz"', '[controller]\nperiod = "3.3333333333 ms"'))
    assert by_period.loop.law.conditioning.sensor_period == 0.0033333333333


@pytest.mark.slow
def test_a_calibration_gives_noise_offset_steps_and_saturation(read, tmp_path):
    random = np.random.default_rng(3)
    distance = np.repeat(np.arange(0, 62, 2), 4)
    clean = 400 + 2e4 * (0.04 / (1e-3 * distance + 0.04)) ** 3
    noisy = np.round(
        clean * (1 + 0.004 * random.standard_normal(distance.size)) + 6 * random.standard_normal(distance.size)
    )
    rows = [f"{d},{y:.0f}" for d, y in zip(distance, noisy, strict=True)]
    rows += [f"inf,{400 + round(6 * random.standard_normal())}" for _ in range(40)]
    (tmp_path / "sensor.csv").write_text("\n".join(["distance [mm],output [counts]", *rows]) + "\n")
    fitted = '[sensor]\ncalibration = "sensor.csv"\nmodel = "inverse-power"\nminimum_distance = "0 mm"\n'
    encounter = fitted + SCENE[SCENE.index("[admittance]") :]
    problem = read(CHAIN + CONTROLLER, encounter)
    best = problem.calibration.best
    chain, known = problem.loop.chain, chain_of_fit(best, rate=250.0)
    assert best.noise.output > 0
    assert (chain.noise, chain.relative_noise, chain.offset) == (known.noise, known.relative_noise, known.offset)
    assert (chain.misfit, chain.misfit_length) == (known.misfit, known.misfit_length)
    assert chain.resolution == known.resolution == 1.0
    assert chain.highest == sensor_part("VCNL4010").chain.highest  # the fit found no clipping
    assert problem.loop.law.conditioning.floor == 3 * best.noise.output
    assert problem.loop.law.conditioning.offset == best.offset.value == pytest.approx(400, abs=5)
    own = read(CHAIN + 'noise = "9 counts"\noffset = "1 count"\n' + CONTROLLER, encounter).loop.chain
    assert (own.noise, own.offset, own.relative_noise) == (9.0, 1.0, known.relative_noise)
    off = read(CHAIN + 'misfit = "2 %"\nmisfit_length = "5 mm"\n' + CONTROLLER, encounter).loop.chain
    assert (off.misfit, off.misfit_length) == (0.02, 0.005)
    clipped = fitted + 'saturation = "18000 counts"\n' + SCENE[SCENE.index("[admittance]") :]
    assert read(CHAIN + CONTROLLER, clipped).loop.chain.highest == 18000.0


def test_a_margin_keeps_the_gain_from_the_limit(read):
    slow = '[chain]\npart = "VL53L5CX-8x8"\n[controller]\nrate = "1 kHz"\nfloor = "1 count"\n'
    free = pt.design(read(slow))
    problem = read(slow + "[loop]\nstability_margin = 2.0\n")
    loop = problem.loop
    expected = gain_limit(
        problem.sensor,
        problem.scenario.admittance,
        timing_of(loop.chain, loop.law),
        distance=np.linspace(0.0, 0.0422, 65),
        plant=loop.plant,
    )
    limit = problem.loop.stability_limit(problem.scenario, problem.sensor)
    assert limit.strongest == expected.strongest
    assert limit.damping.is_certified
    assert -0.4 < limit.strongest < -0.3  # docs/explanation/simulation.md: -0.33 N s, where the optimum is -0.746 N s
    assert free.gain < limit.strongest
    held = pt.design(problem)
    assert problem.stable_bounds() == (limit.strongest / 2, -0.01)
    assert held.gain == pytest.approx(limit.strongest / 2, rel=1e-6)  # the objective falls up to the bound
    quick = read(CHAIN + CONTROLLER + "[loop]\nstability_margin = 2.0\n")
    assert pt.design(quick).gain == pytest.approx(free.gain, rel=1e-6)  # the margin does not act
    assert quick.bounds == (-10.0, -0.01)


def test_the_loop_of_a_file_runs(read):
    problem = read(CHAIN + CONTROLLER + "[verify]\nruns = 8\n")
    found = problem.loop.run(problem.scenario, problem.sensor, pt.design(problem).gain, runs=problem.verify.runs)
    assert found.relative_velocity.shape == (8,)
    # the continuous optimum leaves 0.079 m/s; a force that acts 3 ms late (0.9 ms, and half of the 4 ms that it is
    # held) changes that by up to D_p g l' / M = 4.7 m/s^2 times 3 ms
    np.testing.assert_allclose(found.relative_velocity, -0.079, rtol=0, atol=0.014)


def test_the_sample_of_the_reference_is_read(read):
    page = (ROOT / "docs" / "reference/scenario-file.md").read_text(encoding="utf-8")
    (sample,) = re.findall(r"```toml\n(\[chain\].*?)```", page, re.DOTALL)
    asked = read(sample)
    assert (asked.sensor_part.name, asked.verify.runs, asked.stability_margin) == ("VCNL4010", 500, 2.0)
    assert asked.loop.contact == HuntCrossley(stiffness=1.3e5, dissipation=0.5)


@pytest.mark.parametrize("file", sorted((ROOT / "examples").glob("*.toml")), ids=lambda file: file.name)
def test_every_example_is_read_and_designed(file):
    problem = load_scenario(file)
    assert (problem.loop is not None) == (file.name in {"course.toml", "drag.toml", "loop.toml"})
    assert pt.designs.design_gain(problem.replace(evaluate=None)).status.value == "optimal"


def test_the_example_of_a_loop_is_one_for_every_verb():
    problem = load_scenario(ROOT / "examples" / "loop.toml")
    assert problem.sensor.output(0.0) == pytest.approx(20_000, rel=1e-3)
    assert (
        pt.robust(problem.replace(robust=dataclasses.replace(problem.robust, samples=256, validation=256))).status.value
        == "optimal"
    )
    assert problem.stable_bounds()[0] == problem.loop.stability_limit(problem.scenario, problem.sensor).strongest / 2
    found = problem.loop.run(problem.scenario, problem.sensor, pt.design(problem).gain, runs=50)
    assert np.all(np.abs(found.relative_velocity) < 0.1)  # its own limit
    assert np.all(found.impact_force > 0)


def test_a_file_without_a_loop_loads_no_simulation():
    code = (
        "import sys; from pretouch.config import load_scenario; "
        f"load_scenario({str(ROOT / 'examples' / 'approach.toml')!r}); print(*sys.modules)"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(answer.stdout.split())
    assert not loaded & {"pretouch.simulation", "pretouch.control", "pretouch.config.loop", "scipy"}


def test_a_file_with_a_loop_loads_no_scipy(tmp_path):
    file = tmp_path / "loop.toml"
    file.write_text(SCENE + CHAIN + CONTROLLER + "[loop]\nstability_margin = 2.0\n")
    code = f"import sys; from pretouch.config import load_scenario; load_scenario({str(file)!r}); print(*sys.modules)"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(answer.stdout.split())
    assert "pretouch.simulation" in loaded
    assert "scipy" not in loaded
