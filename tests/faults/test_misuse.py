"""Wrong calls from Python: every public verb and value names the argument, what was found and what is allowed.

Each case is a call that works. One of its arguments is replaced by a value of another type. What must follow is a
PretouchError or a TypeError with a sentence, before anything is computed or written.
"""

from __future__ import annotations

import inspect
import random
import re
import types
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import pretouch as pt
from refusals import refused

MASS = pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0)
SCENARIO = pt.Scenario(admittance=MASS, obstacle=pt.Obstacle(position=0.0422, velocity=-0.3))
SENSOR = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
TASK = pt.Task(SCENARIO, SENSOR, OBJECTIVE, bounds=(-10.0, -0.01))
CHAIN = pt.SensorChain(rate=250.0)
VIRTUAL = pt.control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0)
DAMPER = pt.control.VirtualDamper(gain=-0.7)
CONDITIONING = pt.control.Conditioning(floor=1e-3)
LAW = pt.control.Controller(period=1e-3, conditioning=CONDITIONING, law=DAMPER, admittance=VIRTUAL)
LOOP = pt.ClosedLoop(law=LAW, chain=CHAIN)
TIMING = pt.simulation.LoopTiming(rate=250.0)
LIMIT = pt.Constraint(name="excursion", limit=0.2)
IMPACT = pt.SpringImpact(robot_mass=1.0, stiffness=1e4)
TERM = pt.Term(quantity="displacement", scale=0.5)
DISTANCES = np.linspace(0.0, 0.08, 33)
OUTPUTS = np.exp(-61.0 * DISTANCES) + 1e-3 * np.sin(1e4 * DISTANCES)
READINGS = pt.Calibration(distances=DISTANCES, outputs=OUTPUTS, unit="V")
STATE = pt.find_contact(SCENARIO, SENSOR, -0.7).end


@cache
def report() -> pt.calibration.CalibrationReport:
    return pt.fit(READINGS, ("exponential-1",), offset="zero")


@cache
def fit() -> pt.calibration.SensorFit:
    return pt.calibration.fit_sensor(READINGS, "exponential-1", offset="zero")


class Numbers(NamedTuple):
    """A number for which an array will do."""

    value: Any


class Given(NamedTuple):
    """A valid value, and wrong ones in the place of those that its type has."""

    value: Any
    wrong: tuple[Any, ...]


class Result(NamedTuple):
    """A result of another verb, which is not needed to see that something else is refused."""

    name: str


@dataclass(frozen=True)
class Case:
    """A call with its valid arguments by name; `optional` are those that may be None without such a default."""

    name: str
    arguments: dict[str, Any]
    optional: tuple[str, ...] = ()
    positional: bool = False  # the one argument has no name that a caller could use

    @property
    def call(self) -> Callable[..., Any]:
        found: Any = pt
        for part in self.name.split("."):
            found = getattr(found, part)
        return found  # type: ignore[no-any-return]


THING = object()
TEXT: tuple[Any, ...] = (1, 1.5, b"x", None, [], {}, THING)
NUMBER: tuple[Any, ...] = ("1", "x", b"1", True, 1j, None, [], {}, THING, np.array(["1"], dtype=object))
MANY: tuple[Any, ...] = ("1", "x", b"1", True, 1j, None, {}, THING, ["1", "2"], [1.0, "2"], np.array([True, False]))
WHOLE: tuple[Any, ...] = ("1", b"1", True, 1j, None, [], {}, THING, 1.5)
FLAG: tuple[Any, ...] = ("yes", "", 1, 0, None, [], 1.5, THING)
PAIR: tuple[Any, ...] = ("x", b"ab", 1.0, True, THING, (), (1.0,), (1.0, 2.0, 3.0), ("1", "2"), (True, False), {"a": 1})
SEQUENCE: tuple[Any, ...] = ("x", b"ab", 1.0, True, THING, (THING,), [1j])
OBJECT: tuple[Any, ...] = ("x", b"x", 1, 1.5, True, [], {}, (), THING, None, int)
FUNCTION: tuple[Any, ...] = ("x", 1, [], {}, THING)
MAPPING: tuple[Any, ...] = ("x", 1, [1], THING, {1: 2}, True)
PATH: tuple[Any, ...] = (1, 1.5, True, b"x", None, [], THING)
RESULT = Result("result")


def plain(value: Any) -> Any:
    return value.value if isinstance(value, Numbers | Given) else value


def wrong_values(value: Any) -> tuple[Any, ...]:
    """Return values of types that one argument does not take, by the value that it does."""
    kinds: tuple[tuple[Any, tuple[Any, ...]], ...] = (
        (Given, getattr(value, "wrong", ())),
        (Numbers, MANY),
        (Path, PATH),
        (bool, FLAG),
        (int, WHOLE),
        (float, NUMBER),
        (str, TEXT),
        (dict, MAPPING),
        (tuple, PAIR if len(value) == 2 and all(isinstance(v, float) for v in value) else SEQUENCE)
        if isinstance(value, tuple)
        else ((), ()),
        (np.ndarray, MANY),
        (types.FunctionType, FUNCTION),
    )
    return next((wrong for kind, wrong in kinds if isinstance(value, kind)), OBJECT)


def logarithm(distance: Any) -> Any:
    return -40.0 * distance


def slope(distance: Any) -> Any:
    return np.full_like(distance, -40.0)


TERMS = {"position_scale": 0.5, "velocity_scale": 0.3, "position_weight": 1.0, "velocity_weight": 1.0}
TIMED = {"time_scale": 0.5, "velocity_scale": 0.3, "time_weight": 1.0, "velocity_weight": 1.0}
RANGE = {"minimum_distance": 0.0, "maximum_distance": 1.0}
CHOICE = ("1", b"1", True, 1j, [], {}, THING)  # in the place of a number or one of some words
ASKED = {
    "offset": Given(0.0, (b"1", True, 1j, [], {}, THING, None, "x", ("1", "2"))),
    "saturation": Given(5.0, (b"1", True, 1j, [], {}, THING, "x")),
    "near_field_peak": Given(0.001, (b"1", True, 1j, [], {}, THING, "x")),
    "floor_sigmas": 3.0,
}
RECORDING = pt.recording.Recording(
    source="bag", topic="/range", message_type="", kind="distance", stamps=[0, 10**7], values=[0.5, 0.4]
)
FILE = {
    "path": Path("no.csv"),
    "no_object": Given(0.1, (True, 1j, {}, THING, [True], ["1"], ["x"])),
    "columns": Given({"distance": "d"}, ("x", 1, [1], THING, {1: 2}, True)),
    "labels": Given(("a",), (1, 1.5, THING, True, [THING])),
}
VERBS = [
    *(
        Case(name, {"task": TASK}, positional=True)
        for name in ("design", "designs.design_gain", "designs.design_drag", "designs.design_admittance")
    ),
    *(Case(name, {"task": TASK}, positional=True) for name in ("pareto", "simulate", "verify")),
    Case("verify", {"changes": True}),
    Case("robust", {"task": TASK}, positional=True),
    Case("compare", {"tasks": Given({"a": TASK}, (*MAPPING, None, {"a": 1})), "runs": 2, "notes": ("a",)}, ("runs",)),
    Case("project", {"model": Given(None, OBJECT)}),
    Case("read_recording", {"path": Path("no.csv"), "topic": "a", "clock": "log"}, ("clock",)),
    Case(
        "export",
        {"task": TASK, "folder": Path("law"), "target": "json", "verify": False, "toward_object": False}
        | {"date": "2026-01-01", "overwrite": False},
        ("date",),
    ),
    Case(
        "replay",
        {
            "task": TASK,
            "recording": Given(RECORDING, OBJECT),
            "threshold": 0.5,
            "before": 1.0,
            "start": 0.0,
            "end": 1.0,
        },
    ),
    Case("sensors.check_sensor", {"sensor": SENSOR, "probes": 257}),
    Case("excursion_objective", TERMS),
    Case("time_objective", TIMED),
    Case(
        "find_contact",
        {
            "scenario": SCENARIO,
            "sensor": SENSOR,
            "gain": Numbers(-0.7),
            "law": Given(pt.motion.DAMPER, (1, 1.5, True, [], {}, THING, None, "x")),
            "method": "auto",
            "horizon": 600.0,
        },
    ),
    Case(
        "solve_motion",
        {
            "scenario": SCENARIO,
            "sensor": SENSOR,
            "gain": Numbers(-0.7),
            "law": Given(pt.motion.DAMPER, (1, 1.5, True, [], {}, THING, None, "x")),
            "method": "auto",
            "horizon": 600.0,
            "samples": 200,
        },
    ),
    Case(
        "calibration.fit_sensor",
        {"calibration": READINGS, "model": "inverse-power", **ASKED},
        ("saturation", "near_field_peak"),
    ),
    Case("fit", {"calibration": READINGS, "models": ("table",), **ASKED}, ("saturation", "near_field_peak")),
    Case("load_scenario", {"path": Path("no.toml")}),
    Case("read_calibration", {**FILE, "select": Given({"a": 1}, ("x", 1, [1], THING, True))}),
    Case("calibration.read_calibrations", FILE),
    Case(
        "simulation.simulate_loop",
        {
            "scenario": SCENARIO,
            "sensor": SENSOR,
            "law": LAW,
            "chain": CHAIN,
            "plant": pt.simulation.IdealPlant(),
            "contact": pt.simulation.SpringDamper(stiffness=1e4),
            "runs": 2,
            "seed": 0,
            "horizon": 10.0,
            "follow_time": 0.2,
        },
    ),
    Case(
        "sweep",
        {
            "task": TASK,
            "axes": {"gain": [-0.7]},
            "results": Given(("time",), ("x", b"ab", 1.0, True, THING, (THING,), [1j])),
            "output": Path("x.zarr"),
            "overwrite": False,
            "seed": 0,
            "progress": print,
        },
    ),
    Case(
        "write_report",
        {"result": RESULT, "path": Path("no.html"), "calibration": RESULT, "overwrite": False},
        ("calibration",),
    ),
    Case("report.report_html", {"result": RESULT, "calibration": RESULT}, ("calibration",)),
    Case("report.panel_figure", {"columns": 2, "height": 3.3}),
    Case("uncertainty.parameter_distribution", {"fit": RESULT}),
    Case(
        "uncertainty.sample_inputs",
        {
            "uncertainty": Given(
                {"gain": pt.uncertainty.Normal(mean=0.0, deviation=1.0)}, (*MAPPING, {"gain": 1.0}, None)
            ),
            "count": 8,
            "seed": 0,
            "sampling": "sobol",
        },
    ),
    Case("simulation.chain_of_fit", {"fit": RESULT, "rate": 250.0, "exposure": 0.0, "delay": 0.0}),
    Case(
        "simulation.gain_limit",
        {
            "sensor": SENSOR,
            "admittance": MASS,
            "timing": TIMING,
            "distance": Numbers(0.0),
            "plant": pt.simulation.IdealPlant(),
            "law": Given(pt.motion.DAMPER, (1, 1.5, True, [], {}, THING, "x")),
            "relative_velocity": Numbers(-0.3),
        },
    ),
    Case("simulation.largest_damping", {"admittance": MASS, "timing": TIMING, "plant": pt.simulation.IdealPlant()}),
    Case(
        "simulation.lowest_rate",
        {
            "sensor": SENSOR,
            "admittance": MASS,
            "gain": -0.7,
            "distance": Numbers(0.0),
            "timing_at": lambda rate: pt.simulation.LoopTiming(rate=rate),
            "plant": pt.simulation.IdealPlant(),
            "margin": 2.0,
            "law": Given(pt.motion.DAMPER, (1, 1.5, True, [], {}, THING, "x")),
            "relative_velocity": Numbers(-0.3),
        },
    ),
    Case("simulation.sensor_part", {"name": "VCNL4010"}),
    Case(
        "simulation.speed_limit",
        {
            "sensor": SENSOR,
            "admittance": MASS,
            "timing": TIMING,
            "drag": 0.01,
            "detection_distance": 0.04,
            "plant": pt.simulation.IdealPlant(),
        },
    ),
    Case("simulation.timing_of", {"chain": CHAIN, "controller": LAW}),
    Case(
        "designs.find_physical_bound",
        {"scenario": SCENARIO, "acceleration_limit": Numbers(5.0), "speed_limit": 1.0},
    ),
    Case("designs.quantity_of", {"name": "time", "state": STATE, "impact": IMPACT}),
    Case("reproduce", {"ids": ("table-2",), "progress": print}),
    *(
        Case(f"plots.{name}", {inspect.signature(getattr(pt.plots, name)).parameters.__iter__().__next__(): RESULT})
        for name in pt.plots.__all__
    ),
]
STATE_SPACE = {
    "states": ("position", "velocity"),
    "a": Numbers([[0.0, 1.0], [-2000.0, -90.0]]),
    "b": Numbers([[0.0, 0.0, 0.0, 0.0], [2000.0, 90.0, 0.0, 0.5]]),
    "c": Numbers([1.0, 0.0]),
}
CURVE = {"x": Numbers([0.0, 1.0]), "y": Numbers([0.0, 1.0]), "low": Numbers([0.0, 1.0]), "high": Numbers([0.0, 1.0])}
VALUES = [
    Case("Admittance", {"mass": Numbers(1.0), "damping": Numbers(1.0), "stiffness": Numbers(1.0)}),
    Case(
        "Admittance.from_natural_frequency",
        {"mass": Numbers(1.0), "natural_frequency": Numbers(1.0), "damping_ratio": Numbers(1.0)},
    ),
    Case(
        "Obstacle",
        {
            "position": Numbers(0.04),
            "velocity": Numbers(-0.3),
            "acceleration": Numbers(0.0),
            "course": (pt.motion.Stretch(until=1.0),),
        },
    ),
    Case("motion.Stretch", {"until": Numbers(1.0), "acceleration": Numbers(0.0)}),
    Case("Plant", {"position": Numbers(0.0), "velocity": Numbers(0.0)}),
    Case("Reference", {"position": Numbers(0.0), "velocity": Numbers(0.0), "acceleration": Numbers(0.0)}),
    Case(
        "Scenario",
        {"admittance": MASS, "obstacle": SCENARIO.obstacle, "plant": SCENARIO.plant, "reference": SCENARIO.reference},
    ),
    Case("InversePower", {"scale": 1e-5, "distance_offset": 0.04, "exponent": 3.0, **RANGE}),
    Case("ExponentialFirstOrder", {"scale": 1.0, "rate": -60.0, **RANGE}),
    Case(
        "ExponentialSecondOrder",
        {"scale": 1.0, "rate": -60.0, "curvature": 10.0, **RANGE},
    ),
    Case("MittagLeffler", {"scale": 1.0, "rate": -60.0, "order": 0.7, **RANGE}),
    Case("Table", {"distances": np.array([0.0, 0.1, 1.0]), "outputs": np.array([3.0, 2.0, 1.0]), **RANGE}),
    Case("Recessed", {"sensor": SENSOR, "recess": 0.01, **RANGE}),
    Case(
        "CustomSensor",
        {
            "log_output_function": logarithm,
            "log_slope_function": slope,
            "corners": Given((0.1,), ("x", b"ab", True, THING, (THING,), [1j])),
            **RANGE,
        },
    ),
    Case(
        "Task",
        {
            "scenario": SCENARIO,
            "sensor": SENSOR,
            "objective": Given(OBJECTIVE, ("x", b"x", 1, 1.5, True, [], {}, (), THING, int)),
            "bounds": (-10.0, -0.01),
            "constraints": (LIMIT,),
            "impact": IMPACT,
            "method": "auto",
            "horizon": 600.0,
            "law": Given(pt.motion.DAMPER, (1, 1.5, True, [], {}, THING, "x")),
            "drag_effect": pt.DragEffect(ratio=0.2),
            "evaluate": pt.find_contact,
            "natural_frequency": (1.0, 10.0),
            "damping_ratio": (0.5, 2.0),
            "gain": -0.7,
            "uncertainty": Given({"obstacle.velocity": pt.uncertainty.Normal(mean=-0.3, deviation=0.1)}, MAPPING),
            "loop": LOOP,
            "stability_margin": 2.0,
            "calibration": RESULT,
            "pareto": pt.designs.ParetoOptions(),
            "robust": pt.designs.RobustOptions(),
            "verify": pt.designs.VerifyOptions(),
        },
        ("calibration",),
    ),
    Case(
        "designs.ParetoOptions",
        {
            "quantities": ("displacement", "relative_velocity"),
            "choice": Given(-0.7, ("1", b"1", True, 1j, [], {}, THING)),
        },
    ),
    Case(
        "designs.RobustOptions",
        {
            "measure": pt.designs.Expected(),
            "samples": 64,
            "validation": 64,
            "seed": 0,
            "sampling": "sobol",
            "confidence": 0.95,
        },
    ),
    Case("designs.VerifyOptions", {"runs": 100, "confidence": 0.95, "speed_tolerance": 0.1}),
    Case("Constraint", {"name": "excursion", "limit": 0.2}),
    Case("Term", {"quantity": "displacement", "scale": Given(0.5, CHOICE), "weight": 1.0}),
    Case("Objective", {"terms": (TERM,), "name": "own"}),
    Case(
        "designs.ContactQuantity",
        {
            **{"name": "misused", "value": lambda state, _: state.time, "unit": "s", "words": "a", "symbol": "t"},
            **{"needs_impact": False, "is_magnitude": True},
        },
    ),
    Case("HertzImpact", {"robot_mass": 1.0, "obstacle_mass": 2.0, "effective_modulus": 1e7, "radius": 0.01}),
    Case("SpringImpact", {"robot_mass": 1.0, "obstacle_mass": 2.0, "stiffness": 1e4}),
    Case("designs.ElasticImpact", {"robot_mass": 1.0, "obstacle_mass": 2.0, "stiffness": 1e4, "exponent": 1.5}),
    *(
        Case("DragEffect", {name: value})
        for name, value in {
            "ratio": Given(0.2, (*MANY[:5], {}, THING)),
            "excursion": 0.05,
            "acceleration": 3.0,
            "contact_speed": 0.1,
            "impact_force": 10.0,
            "largest_speed": 0.5,
        }.items()
    ),
    Case(
        "designs.PhysicalBound",
        {
            "distance": 0.04,
            "velocity": -0.3,
            "acceleration": 0.0,
            "acceleration_limit": Numbers(5.0),
            "speed_limit": 1.0,
        },
    ),
    Case(
        "Calibration",
        {
            "distances": DISTANCES,
            "outputs": OUTPUTS,
            "unit": "V",
            "no_object": Numbers([0.1, 0.2]),
            "label": "a",
        },
    ),
    Case(
        "SensorChain",
        {
            **dict.fromkeys(("phase", "exposure", "delay", "noise", "relative_noise", "offset", "crosstalk"), 0.0),
            **{"rate": 100.0, "random_phase": False, "resolution": 0.0, "dropout": 0.0, "measures_distance": False},
            **{"jitter": 0.0, "misfit": 0.0, "misfit_length": 0.1, "drift": 0.0, "lowest": 0.0, "highest": 10.0},
        },
    ),
    Case(
        "simulation.LoopTiming",
        {
            "rate": 250.0,
            "delay": 0.0,
            "hold": 0.001,
            "exposure": 0.0,
            "smoothing": 0.0,
            "sections": Given((), ("x", 1)),
        },
    ),
    Case(
        "ClosedLoop",
        {
            "law": LAW,
            "chain": CHAIN,
            "plant": pt.simulation.IdealPlant(),
            "contact": pt.simulation.SpringDamper(stiffness=1e4),
            "seed": 0,
            "first_run": 0,
            "horizon": 10.0,
            "follow_time": 0.2,
        },
    ),
    Case(
        "simulation.ImpedancePlant",
        {
            **{"mass": 1.0, "stiffness": 1e3, "damping": 10.0, "bandwidth": 100.0, "viscous_friction": 0.0},
            **{"coulomb_friction": 0.0, "friction_speed": 1e-3, "feedforward": True},
        },
    ),
    *(Case(f"simulation.{name}", STATE_SPACE) for name in ("StateSpace", "StateSpacePlant")),
    Case("simulation.PositionPlant", {"mass": 1.0, "bandwidth": 10.0, "damping_ratio": 1.0}),
    Case("simulation.Disturbance", {"kind": "cable", "time": 0.05, "duration": 0.02}),
    Case("simulation.HuntCrossley", {"obstacle_mass": 1.0, "stiffness": 1e4, "dissipation": 0.0, "exponent": 1.5}),
    Case("simulation.SpringDamper", {"obstacle_mass": 1.0, "stiffness": 1e4, "damping": 0.0}),
    Case("designs.ConditionalValueAtRisk", {"probability": 0.9}),
    Case("designs.Quantile", {"probability": 0.9}),
    Case("designs.Required", {"constraint": LIMIT, "probability": 0.9}),
    Case(
        "uncertainty.CorrelatedNormal",
        {
            "names": ("gain",),
            "mean": Given((1.0,), ("x", THING, ("1",), (True,), {}, (1j,))),
            "covariance": Given(((1.0,),), ("x", THING, (("1",),), ((True,),), {}, ((1j,),))),
        },
    ),
    Case(
        "uncertainty.Empirical", {"samples": Given((1.0, 2.0, 3.0), ("x", 1.0, THING, ("1", "2"), (True, False), {}))}
    ),
    Case("uncertainty.Interval", {"low": 0.0, "high": 1.0}),
    Case("uncertainty.Uniform", {"low": 0.0, "high": 1.0}),
    Case("uncertainty.Normal", {"mean": 0.0, "deviation": 1.0}),
    Case("uncertainty.TruncatedNormal", {"location": 0.0, "deviation": 1.0, "low": -1.0, "high": 1.0}),
    Case(
        "report.Curve",
        {**CURVE, "label": "a", "style": 1, "kind": "line", "quiet": False, "end": "b"},
    ),
    Case("report.Map", {"x": Numbers([0.0, 1.0]), "y": Numbers([0.0, 1.0]), "values": Numbers(np.ones((2, 2)))}),
    Case("report.Mark", {"x": 0.0, "y": 0.0, "label": "a", "style": 1, "shape": "dot"}),
    Case(
        "report.Panel",
        {
            **{
                "x_label": "a [m]",
                "y_label": "b [m]",
                "curves": (pt.report.Curve(x=[0.0, 1.0], y=[0.0, 1.0]),),
                "title": "c",
            },
            **{"marks": (pt.report.Mark(x=0.0, y=0.0),), "spans": (pt.report.Span(start=0.0, end=1.0),)},
            **{"levels": {"a": 1.0}, "positions": {"a": 1.0}, "x_log": False, "y_log": False},
            **{"x_limits": (0.0, 1.0), "y_limits": (0.0, 1.0)},
        },
    ),
    Case("report.Span", {"start": 0.0, "end": 1.0, "label": "a", "kind": "blocked"}),
    Case(
        "control.Conditioning",
        {
            **{"floor": 1e-3, "offset": 0.0, "saturation": 5.0, "sensor_period": 4e-3, "median_window": 1},
            **{"low_pass_order": 1, "cutoff": 50.0, "timeout": 0.1, "fade_time": 0.1, "largest_rate": 100.0},
        },
    ),
    Case(
        "control.Controller",
        {
            **{"period": 1e-3, "conditioning": CONDITIONING, "law": DAMPER, "admittance": VIRTUAL},
            **{"limits": pt.control.Limits(), "contact_gain": 0.0, "contact_threshold": 1.0},
        },
    ),
    Case("control.Limits", {"force": 1.0, "speed": 1.0, "acceleration": 1.0, "excursion": 1.0}),
    Case("control.VirtualAdmittance", {"mass": 1.0, "damping": 1.0, "stiffness": 1.0}),
    Case("control.VirtualDamper", {"gain": -0.7, "approach_only": False, "release": 0.0, "ramp_time": 0.0}),
    Case(
        "control.VirtualDrag",
        {
            **{"drag": 0.01, "noise": 1e-3, "relative_noise": 0.0, "resolution": 0.0, "smoothing_time": 0.007},
            **{"dead_zone": 10.0, "still_rate": 3.0, "hold_time": 0.1, "own_advance": 0.0, "known_acceleration": 0.0},
        },
    ),
    Case(
        "motion.CustomLaw",
        {
            "kind": "cubic",
            "number": pt.motion.LawNumber("cube", "c", "N*s^3", 1),
            "force": logarithm,
            "damping": slope,
            "suspends_admittance": False,
        },
    ),
]
RESULTS = [
    "designs.AdmittanceDesign",
    "calibration.CalibrationReport",
    "motion.ContactResult",
    "motion.ContactStatus",
    "designs.DesignStatus",
    "designs.GainDesign",
    "motion.Motion",
    "designs.ParetoFront",
    "calibration.SensorFit",
    "verification.SimulatedEncounter",
    "verification.Verdict",
    "verification.VerdictStatus",
    "designs.RobustDesign",
    "simulation.DampingLimit",
    "simulation.GainLimit",
    "simulation.LoopTrace",
    "simulation.SensorPart",
    "simulation.SimulationResult",
    "simulation.SpeedLimit",
    "control.Observation",
    "control.Output",
    "control.Push",
    "control.Arrival",
    "control.Status",
    "motion.ContactGradients",
    "motion.ContactState",
    "designs.AdmittanceCertificate",
    "designs.AdmittanceMap",
    "designs.AdmittanceMinimum",
    "designs.BoundComparison",
    "designs.Certificate",
    "designs.ConstraintOutcome",
    "designs.DragDesign",
    "designs.FrontPoint",
    "designs.FrontStatus",
    "designs.IdealDesign",
    "designs.Sensitivity",
    "designs.TradeOff",
    "uncertainty.Ensemble",
    "uncertainty.Reservations",
    "letter.Agreement",
    "letter.Finding",
    "letter.LetterReport",
    "letter.Parameter",
    "letter.Printed",
    "letter.Reproduction",
    "letter.Step",
]
"""What pretouch makes and hands out."""

ROOMS = ("plots", "report", "simulation", "control", "motion", "designs", "uncertainty", "letter")
INTERFACES = [
    "sensors.SensorModel",
    "uncertainty.Distribution",
    "uncertainty.JointDistribution",
    "designs.Measure",
    "designs.Expected",
    "designs.WorstCase",
    "simulation.ContactModel",
    "simulation.PlantModel",
    "simulation.IdealPlant",
    "simulation.LinearPlant",
    "control.Law",
    "control.Setting",
    "control.Parts",
    "control.CompiledStep",
    "control.Run",
    "control.Sample",
    "control.drive",
    "control.observe",
    "control.push_by_drag",
    "control.start_drive",
    "control.start_sensing",
    "motion.ContinuousLaw",
    "motion.LawNumber",
    "designs.ImpactModel",
    "designs.Evaluator",
    "uncertainty.Uncertainty",
    "uncertainty.make_ensemble",
    "uncertainty.reservations_apply",
    "uncertainty.reservations_of",
]
"""What classes of a user's own inherit or call at every step, and values without arguments."""


def misuses() -> Iterator[tuple[Case, str, Any]]:
    """Yield every case with each of its arguments and every wrong value for it."""
    for case in (*VERBS, *VALUES):
        for name, value in case.arguments.items():
            if isinstance(value, Result) and name == "result":
                wrong: tuple[Any, ...] = ("x", 1, None, THING, [], {})
            else:
                wrong = wrong_values(value)
            for bad in wrong:
                if bad is None and may_be_none(case, name):
                    continue
                yield case, name, bad


def may_be_none(case: Case, name: str) -> bool:
    parameter = inspect.signature(case.call).parameters[name]
    return parameter.default is None or name in case.optional


def attempt(case: Case, name: str, bad: Any) -> BaseException | None:
    """Return what a call raises whose other arguments are valid."""
    arguments = {key: plain(value) for key, value in case.arguments.items()}
    arguments |= {k: report() if k == "calibration" else fit() for k, v in arguments.items() if isinstance(v, Result)}
    arguments[name] = bad
    leading = [arguments.pop(name)] if case.positional else []
    if case.name == "verify" and not case.positional:
        leading = [TASK]
    try:
        case.call(*leading, **arguments)
    except Exception as error:
        return error
    return None


def complaint(case: Case, name: str, bad: Any) -> str | None:
    """Say what is wrong with how a wrong call ends; None where it ends as it must."""
    call, error = f"{case.name}({name}={bad!r})", attempt(case, name, bad)
    if error is None:
        return f"{call} is accepted"
    text = str(error)
    if not isinstance(error, pt.errors.PretouchError | TypeError):
        return f"{call} ends in {type(error).__name__}: {text}"
    names = "|".join((name, name.replace("_", " "), name.removesuffix("s")))
    if not (re.search(rf"\b({names})\b", text) and "found" in text and ("expected" in text or "must" in text)):
        return f"{call} says too little: {type(error).__name__}: {text}"
    return None


ALL = list(misuses())
CALLS = 1000


@pytest.mark.parametrize("case", [*VERBS, *VALUES], ids=lambda case: f"{case.name}-{next(iter(case.arguments))}")
def test_every_wrong_type_is_refused_with_a_sentence(case: Case) -> None:
    found = [complaint(case, name, bad) for one, name, bad in ALL if one is case]
    assert found
    assert [said for said in found if said is not None] == []


def random_value(draw: random.Random, depth: int = 0) -> Any:
    """Return a value that is of no use to any argument: text, containers of text and of truth values, other objects."""
    simple = ("1", "x", "", b"1", 1j, True, THING, ..., int, len, np.str_("1"), np.array(["1"]), np.array([1j]))
    if depth == 2 or draw.random() < 0.6:
        return draw.choice(simple)
    items = [random_value(draw, depth + 1) for _ in range(draw.randrange(1, 4))]
    kind = draw.choice((list, tuple, dict))
    return dict(enumerate(items)) if kind is dict else kind(items)


def is_allowed(value: Any, bad: Any) -> bool:
    """Tell whether a random value is one that the argument takes after all."""
    kind = plain(value)
    if isinstance(kind, str | Path) or isinstance(value, Given):  # a text, or one of several types
        return True
    if isinstance(kind, bool):
        return isinstance(bad, bool)
    if isinstance(kind, tuple | list) and isinstance(bad, tuple | list):
        return any(isinstance(item, str) for item in bad)
    if isinstance(bad, np.ndarray) and bad.dtype.kind == "U":  # names may be an array of texts
        return isinstance(kind, tuple | list) and all(isinstance(item, str) for item in kind)
    return callable(kind) and callable(bad) and not isinstance(bad, type)


def test_a_thousand_random_wrong_calls_end_in_a_sentence() -> None:
    draw, found, tried = random.Random(23), [], 0  # noqa: S311 - draws wrong calls, no secrets
    cases = [(case, name) for case in (*VERBS, *VALUES) for name in case.arguments]
    while tried < CALLS:
        case, name = draw.choice(cases)
        bad = random_value(draw)
        if is_allowed(case.arguments[name], bad):
            continue
        tried += 1
        said = complaint(case, name, bad)
        if said is not None:
            found.append(said)
    assert found == []


def test_every_public_name_is_tried_or_is_none_that_takes_arguments_of_a_user() -> None:
    """A new verb or value is forgotten here no longer than until this test runs."""
    public = {}
    for place in ("", *ROOMS):
        room = getattr(pt, place) if place else pt
        for name in room.__all__:
            value = getattr(room, name)
            if callable(value) and not (inspect.isclass(value) and issubclass(value, Exception)):
                public.setdefault(value, f"{place}.{name}".removeprefix("."))
    tried = {case.name for case in (*VERBS, *VALUES)} - {"Admittance.from_natural_frequency"}
    listed = tried | set(RESULTS) | set(INTERFACES)
    assert set(public.values()) == {name for name in listed if name.partition(".")[0] in ROOMS or "." not in name}
    assert not (tried & set(RESULTS))
    assert not (tried & set(INTERFACES))
    assert not (set(RESULTS) & set(INTERFACES))


@pytest.mark.parametrize(
    ("call", "fields"),
    [
        (lambda: pt.design("x"), {"argument": "task", "value": "x"}),
        (lambda: pt.verify(None), {"argument": "task"}),
        (lambda: TASK.replace(bounds="x"), {"argument": "bounds", "value": "x"}),
        (lambda: TASK.replace(bounds=("-1", "0")), {"argument": "bounds", "value": ("-1", "0")}),
        (lambda: pt.designs.VerifyOptions(runs=True), {"argument": "runs", "value": True}),
        (lambda: TASK.replace(loop=LAW), {"argument": "loop"}),
        (lambda: pt.find_contact(SCENARIO, pt.InversePower, -0.7), {"argument": "sensor"}),
        (lambda: pt.find_contact(SENSOR, SCENARIO, -0.7), {"argument": "scenario"}),
        (lambda: pt.find_contact(SCENARIO, SENSOR, "-0.7"), {"argument": "gain", "value": "-0.7"}),
        (
            lambda: pt.find_contact(SCENARIO, SENSOR, -0.7, horizon=[1.0, 2.0]),
            {"argument": "horizon"},
        ),
        (lambda: pt.Admittance(mass=b"1", damping=1.0, stiffness=1.0), {"argument": "mass", "value": b"1"}),
        (
            lambda: pt.Scenario(admittance=1.0, obstacle=SCENARIO.obstacle),
            {"argument": "admittance", "value": 1.0},
        ),
        (
            lambda: pt.plots.motion(SCENARIO),
            {"argument": "design"},
        ),
        (
            lambda: SENSOR.log_slope("0.01"),
            {"argument": "distance", "value": "0.01"},
        ),
        (lambda: SENSOR.contains(True), {"argument": "distance", "value": True}),
        (lambda: pt.report.panel_figure("x"), {"argument": "panels", "value": "x"}),
    ],
)
def test_the_error_names_argument_and_value(call: Callable[[], object], fields: dict[str, Any]) -> None:
    with refused(**fields):
        call()


@pytest.mark.parametrize(
    "kind",
    [int, np.int8, np.int64, np.uint16, np.float32, np.float64, np.array, Fraction, Decimal],
    ids=lambda k: k.__name__,
)
def test_numbers_of_every_kind_are_numbers(kind: Callable[[int], Any]) -> None:
    two = kind(2)
    admittance = pt.Admittance(mass=two, damping=two, stiffness=two)
    assert (type(admittance.mass), admittance.mass) == (float, 2.0)
    assert pt.Constraint(name="excursion", limit=two).limit == 2
    assert pt.SpringImpact(robot_mass=two, stiffness=two).peak_force(-1.0) == pytest.approx(2.0)
    assert pt.find_contact(SCENARIO, SENSOR, -0.7, horizon=two).reached
    expected = pt.design(TASK.replace(bounds=(-10.0, 2.0), horizon=2.0)).gain
    assert pt.design(TASK.replace(bounds=(-10, two), horizon=two)).gain == expected


@pytest.mark.parametrize("kind", [int, np.int8, np.int64, np.uint16])
def test_whole_numbers_of_every_kind_are_whole_numbers(kind: Callable[[int], Any]) -> None:
    assert len(pt.solve_motion(SCENARIO, SENSOR, -0.7, samples=kind(7)).time) == 7
    normal = {"gain": pt.uncertainty.Normal(mean=0.0, deviation=1.0)}
    assert len(pt.uncertainty.sample_inputs(normal, kind(4), seed=kind(1))["gain"]) == 4
    assert pt.simulation.simulate_loop(SCENARIO, SENSOR, LAW, runs=kind(2), seed=kind(1)).relative_velocity.shape == (
        2,
    )


def test_arrays_and_sequences_of_numbers_are_numbers() -> None:
    for pair in ([-10.0, -0.01], np.array([-10.0, -0.01]), (-10, np.float32(-0.01))):
        assert pt.design(TASK.replace(bounds=pair)).gain == pytest.approx(pt.design(TASK).gain, rel=1e-6)
    for many in ([-0.7, -0.8], (-0.7, -0.8), np.array([-0.7, -0.8]), np.array([-0.7, -0.8], dtype=object)):
        assert pt.find_contact(SCENARIO, SENSOR, many).reached.shape == (2,)
    assert np.asarray(SENSOR.log_slope([0.01, 0.02])).shape == (2,)
    assert SENSOR.log_slope(Fraction(1, 100)) == SENSOR.log_slope(0.01)


BEYOND = [10**400, -(10**5000), Fraction(10**400), Decimal("1e400"), Decimal("sNaN"), np.ma.masked]


@pytest.mark.parametrize("huge", BEYOND, ids=lambda value: type(value).__name__)
def test_a_number_beyond_all_floats_is_refused(huge: Any) -> None:
    for call in (
        lambda: pt.Constraint(name="excursion", limit=huge),
        lambda: pt.SpringImpact(robot_mass=huge, stiffness=1.0),
        lambda: pt.Admittance(mass=huge, damping=1.0, stiffness=1.0),
        lambda: pt.simulation.sensor_part(huge),
    ):
        with pytest.raises(pt.errors.InvalidInputError, match=r"found .*(must be finite|expected)"):
            call()


def test_a_true_of_numpy_is_a_flag() -> None:
    assert pt.control.VirtualDamper(gain=-0.7, approach_only=np.bool_(True)).approach_only


def test_a_task_may_be_given_by_its_name() -> None:
    assert pt.design(task=TASK).gain == pt.design(TASK).gain
