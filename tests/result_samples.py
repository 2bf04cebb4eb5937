"""One of everything that pretouch returns, and of what it is asked with: made anew by each call of `fresh`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

import pretouch as pt
from pretouch import control, uncertainty
from pretouch.designs import find_physical_bound
from pretouch.designs.drag import DragLimits, drag_by, drag_trade_off
from pretouch.sensors import PiecewiseCubic
from pretouch.sweeps import Axis, Progress
from pretouch.verification import calibration_check, compare
from robust_samples import with_robust_options
from verification_samples import (
    BOUNDS,
    NOISY,
    OBJECTIVE,
    SCENARIO,
    SENSOR,
    controller,
    short_rest,
    velocity_limit,
    verdict,
)

EXAMPLES = Path(__file__).parents[1] / "examples"
CONSTANT = pt.ExponentialFirstOrder(scale=0.458, rate=-61.0)
SEVERAL = replace(SCENARIO, obstacle=pt.Obstacle(position=0.0422, velocity=np.linspace(-0.35, -0.2, 12)))
STOPS = (pt.motion.Stretch(until=0.05), pt.motion.Stretch(until=np.linspace(0.1, 0.2, 12), acceleration=3.0))
SPEED = {"obstacle.velocity": pt.uncertainty.Uniform(low=-0.4, high=-0.2)}
LIMITS = (pt.Constraint(name="relative_velocity", limit=0.09),)
IMPACT = pt.SpringImpact(robot_mass=2.0, stiffness=1e4)
FREE = {"damping_ratio": (0.7, 1.3)}
ROBOT = pt.simulation.ImpedancePlant(mass=2.0, stiffness=4000.0, damping=180.0, bandwidth=60.0)
TOUCHING = replace(NOISY, plant=ROBOT, contact=pt.simulation.HuntCrossley(stiffness=2e6, dissipation=1.0))


def log_output(distance: Any) -> Any:
    return -40 * distance


def log_slope(distance: Any) -> Any:
    return np.full_like(distance, -40.0)


def cubic(value: float, output: float, rate: float) -> float:
    """Push as a user's law may."""
    return -value * max(rate, 0.0) ** 3


MATRICES = pt.simulation.StateSpacePlant(
    states=("position", "velocity"),
    a=[[0.0, 1.0], [-2000.0, -90.0]],
    b=[[0.0] * 4, [2000.0, 90.0, 1.0, 0.5]],
    c=[1.0, 0.0],
)


def energy(state: Any, impact: Any) -> Any:
    """Return a quantity as a user may define it."""
    return 0.5 * np.square(state.relative_velocity)


ENERGY = pt.designs.ContactQuantity("energy_of_1_kg", energy, unit="J")
OWN_LAW = pt.motion.CustomLaw(kind="cubic", number=pt.motion.LawNumber("cube", "c", "N*s^3", 1), force=cubic)


def half(scenario: Any, sensor: Any, gain: Any) -> pt.motion.ContactResult:
    """Solve encounters as a user's function may."""
    return pt.find_contact(scenario, sensor, 0.5 * np.asarray(gain))


@cache
def _report() -> pt.calibration.CalibrationReport:
    return pt.fit(pt.read_calibration(EXAMPLES / "sensor.csv"))


def _robust(**options: Any) -> pt.designs.RobustDesign:
    given = {"bounds": BOUNDS, "uncertainty": SPEED, "samples": 64, "validation": 64} | options
    return pt.robust(pt.Task(SCENARIO, SENSOR, OBJECTIVE, **with_robust_options(**given)))


def _calibrated_verdict() -> pt.verification.Verdict:
    """Judge a gain on a calibrated sensor, with fewer possible sensor curves than usual."""
    with mock.patch.object(calibration_check, "_DRAWS", 20), short_rest():
        return verdict(NOISY, calibration=_report(), runs=4, changes=False)


def _signals(law: control.Controller) -> tuple[Any, ...]:
    parameters, sample = law.parameters(), control.Sample(reading=0.1)
    sensing, seen = control.observe(parameters.sensing, control.start_sensing(parameters.sensing), sample)
    state, output = law.step(parameters, law.start(), sample)
    given = control.Parts(sensing, state.drive, (0.1,)), control.Push(-1e-3, 0.0)
    return parameters, sensing, state, sample, seen, output, *given


RESULTS: dict[str, Callable[[], Any]] = {
    "contact": lambda: pt.find_contact(SCENARIO, SENSOR, -0.7),
    "contact, closed form": lambda: pt.find_contact(SCENARIO, CONSTANT, -0.7),
    "contacts": lambda: pt.find_contact(SEVERAL, SENSOR, -0.7),
    "contacts, closed form": lambda: pt.find_contact(SEVERAL, CONSTANT, np.linspace(-2, 2, 24)[:, None]),
    "contacts, uniform motion": lambda: pt.find_contact(
        SEVERAL, pt.ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0), -0.7, method="uniform-motion"
    ),
    "contacts, loop": lambda: NOISY(SEVERAL, SENSOR, -0.7),
    "contacts, like sensors": lambda: uncertainty.make_ensemble(
        SCENARIO, SENSOR, {"sensor.exponent": [3.0, 3.5]}
    ).contacts(-0.7),
    "contacts, other sensors": lambda: uncertainty.make_ensemble(
        SCENARIO, pt.MittagLeffler(scale=1.0, rate=-80.0, order=0.8), {"sensor.order": [0.75, 0.8]}
    ).contacts(-0.7),
    "contacts, own law": lambda: pt.find_contact(SEVERAL, SENSOR, 1e-3, law=OWN_LAW),
    "no contact": lambda: pt.find_contact(SCENARIO, SENSOR, -0.7, horizon=0.01),
    "gradients": lambda: pt.find_contact(SEVERAL, SENSOR, -0.7).gradients,
    "gradients, like sensors": lambda: (
        uncertainty.make_ensemble(SCENARIO, SENSOR, {"sensor.exponent": [3.0, 3.5]}).contacts(-0.7).gradients
    ),
    "motion": lambda: pt.solve_motion(SCENARIO, SENSOR, [-0.7, -0.5], samples=20),
    "design": lambda: pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, constraints=LIMITS, impact=IMPACT)),
    "design, settled": lambda: pt.design(pt.Task(SCENARIO, CONSTANT, OBJECTIVE, bounds=BOUNDS)),
    "design, infeasible": lambda: pt.design(
        pt.Task(
            SCENARIO,
            CONSTANT,
            OBJECTIVE,
            bounds=BOUNDS,
            constraints=[pt.Constraint(name="relative_velocity", limit=1e-5)],
        )
    ),
    "design on a loop": lambda: pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=(-1.0, -0.5), evaluate=NOISY)),
    "design on a function": lambda: pt.design(pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, evaluate=half)),
    "designs": lambda: pt.design(pt.Task(SEVERAL, SENSOR, OBJECTIVE, bounds=BOUNDS)),
    "designs on a loop": lambda: pt.design(
        pt.Task(
            replace(SEVERAL, obstacle=pt.Obstacle(position=0.0422, velocity=np.array([-0.3, -0.2]))),
            SENSOR,
            OBJECTIVE,
            bounds=(-1.0, -0.5),
            evaluate=NOISY,
        )
    ),
    "admittance": lambda: pt.design(pt.Task(SCENARIO, CONSTANT, OBJECTIVE, bounds=BOUNDS, **FREE)),
    "front": lambda: pt.pareto(
        pt.Task(
            SCENARIO,
            CONSTANT,
            bounds=BOUNDS,
            pareto=pt.designs.ParetoOptions(choice=-0.8),
            constraints=[pt.Constraint(name="acceleration", limit=3.0)],
        )
    ),
    "front with admittance": lambda: pt.pareto(pt.Task(SCENARIO, CONSTANT, bounds=BOUNDS, **FREE)),
    "drag": lambda: pt.design(
        pt.Task(SCENARIO, SENSOR, OBJECTIVE, constraints=LIMITS, drag_effect=pt.DragEffect(ratio=0.15))
    ),
    "drags": lambda: drag_trade_off(SENSOR, 0.0422, 1.0, np.array([0.5, 0.1])),
    "rails": lambda: DragLimits(
        weak=drag_by(SENSOR, 0.0422, 1.0, ratio=0.3), strong=drag_by(SENSOR, 0.0422, 1.0, ratio=0.1)
    ),
    "bound": lambda: find_physical_bound(SCENARIO, acceleration_limit=2.0),
    "robust": lambda: _robust(constraints=[velocity_limit(0.12, 0.9)], measure=pt.designs.Quantile(probability=0.9)),
    "robust, worst case": lambda: _robust(measure=pt.designs.WorstCase()),
    "robust on a loop": lambda: _robust(
        evaluate=NOISY, bounds=(-1.0, -0.5), measure=pt.designs.ConditionalValueAtRisk(probability=0.9), samples=8
    ),
    "fit": lambda: pt.calibration.fit_sensor(pt.read_calibration(EXAMPLES / "sensor.csv"), "inverse-power"),
    "ranking": lambda: replace(_report()),
    "distribution": lambda: pt.uncertainty.parameter_distribution(_report().best),
    "reservations": lambda: uncertainty.reservations_of(_report(), pt.load_scenario(EXAMPLES / "fingertip.toml")),
    "simulation": lambda: TOUCHING.run(SCENARIO, SENSOR, -0.7),
    "simulations": lambda: NOISY.run(SEVERAL, SENSOR, -0.7),
    "trace": lambda: NOISY.run(SCENARIO, SENSOR, -0.7).trace(),
    "encounter": lambda: pt.simulate(pt.Task(SCENARIO, SENSOR, loop=TOUCHING, gain=-0.7, impact=IMPACT)),
    "verdict": lambda: verdict(NOISY, constraints=[velocity_limit(0.1)], runs=12),
    "verdict, uncertain sensor": lambda: verdict(
        NOISY, uncertainty={"sensor.exponent": pt.uncertainty.Uniform(low=3.2, high=3.4)}, runs=4, changes=False
    ),
    "verdict, calibrated sensor": _calibrated_verdict,
    "comparison of candidates": lambda: compare(
        {
            name: pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=BOUNDS, loop=replace(NOISY, seed=seed))
            for name, seed in (("a", 1), ("b", 2))
        },
        runs=4,
    ),
    "gain limit": lambda: pt.simulation.gain_limit(
        SENSOR, SCENARIO.admittance, pt.simulation.timing_of(NOISY.chain, NOISY.law), distance=[0.0, 0.04]
    ),
    "speed limit": lambda: pt.simulation.speed_limit(
        SENSOR, SCENARIO.admittance, pt.simulation.LoopTiming(rate=250.0), 0.0144, detection_distance=0.0422
    ),
    "conformance": lambda: pt.sensors.check_sensor(SENSOR),
    "letter": lambda: pt.letter.reproduce(["figure-5", "impact-force"]),
    "progress": lambda: Progress(finished=1, total=2, seconds=3.0),
}
"""What is returned, by name."""

REQUESTS: dict[str, Callable[[], Any]] = {
    "problem": lambda: pt.load_scenario(EXAMPLES / "approach.toml"),
    "problem with a loop": lambda: pt.load_scenario(EXAMPLES / "loop.toml"),
    "problem with a drag": lambda: pt.load_scenario(EXAMPLES / "drag.toml"),
    "encounters": lambda: SEVERAL,
    "laws": lambda: (pt.motion.DRAG, OWN_LAW),
    "own quantity": lambda: (ENERGY, pt.Objective(terms=(pt.Term(quantity=ENERGY, scale=1.0),))),
    "linear robot": lambda: (MATRICES, MATRICES.system()),
    "encounters with a course": lambda: replace(SEVERAL, obstacle=replace(SEVERAL.obstacle, course=STOPS)),
    "effect": lambda: pt.DragEffect(acceleration=2.0, largest_speed=0.5),
    "objective": lambda: pt.time_objective(time_scale=1.0, velocity_scale="obstacle speed"),
    "ensemble": lambda: uncertainty.make_ensemble(SCENARIO, SENSOR, {"sensor.exponent": [3.0, 3.5]}),
    "axis": lambda: Axis(name="gain", columns={"gain": np.linspace(-1.0, -0.5, 3)}),
    "loop": lambda: TOUCHING,
    "timing": lambda: pt.simulation.timing_of(NOISY.chain, NOISY.law),
    "part": lambda: pt.simulation.sensor_part("VCNL4010"),
    "disturbance": lambda: pt.simulation.Disturbance(kind="cable", time=0.05),
    "position plant": lambda: pt.simulation.PositionPlant(mass=2.0, bandwidth=20.0),
    "hertz": lambda: pt.HertzImpact(robot_mass=1.0, effective_modulus=1e7, radius=0.01),
    "elastic": lambda: pt.designs.ElasticImpact(robot_mass=1.0, stiffness=1e5, exponent=2.2),
    "spring damper": lambda: pt.simulation.SpringDamper(stiffness=1e4, damping=3.0),
    "controller": lambda: replace(controller(1e-3), limits=control.Limits(speed=1.0)),
    "controller with a drag": lambda: replace(controller(1e-3), law=control.VirtualDrag(drag=0.0144, noise=1e-3)),
    "expected": pt.designs.Expected,
    "signals": lambda: _signals(controller(1e-3)),
    "map": lambda: pt.report.Map(
        x=[0.1, 0.2], y=[-1.0, 0.0, 1.0], values=[[1.0, 2.0], [3.0, float("nan")], [5.0, 6.0]]
    ),
    "panel": lambda: pt.report.Panel(
        x_label="t [s]",
        y_label="l [m]",
        curves=(pt.report.Curve(label="l", x=[0.0, 1.0], y=[0.0, 1.0]),),
        marks=(pt.report.Mark(label="end", x=1.0, y=1.0),),
        spans=(pt.report.Span(start=0.2, end=0.4, label="near"),),
    ),
    "curves": lambda: (
        CONSTANT,
        pt.ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0),
        pt.MittagLeffler(scale=1.0, rate=-80.0, order=0.8),
        pt.Table(distances=(0.0, 0.01, 0.02, 0.03), outputs=(0.4, 0.3, 0.2, 0.1)),
        PiecewiseCubic(distances=(0.0, 0.01), log_outputs=(1.0, 0.0), slopes=((-90.0, -110.0),)),
        pt.Recessed(sensor=SENSOR, recess=0.01),
        pt.CustomSensor(log_output_function=log_output, log_slope_function=log_slope),
    ),
    "distributions": lambda: (
        pt.uncertainty.Normal(mean=1.0, deviation=0.1),
        pt.uncertainty.TruncatedNormal(location=1.0, deviation=0.1, low=0.8, high=1.2),
        pt.uncertainty.Uniform(low=0.0, high=1.0),
        pt.uncertainty.Interval(low=0.0, high=1.0),
        pt.uncertainty.Empirical(samples=(1.0, 2.0, 3.0)),
        pt.uncertainty.CorrelatedNormal(names=("a", "b"), mean=(1.0, 2.0), covariance=((1.0, 0.0), (0.0, 1.0))),
    ),
}
"""What is asked with, by name."""
