"""pretouch chooses the gain of a proximity-sensor-based preemptive impact controller without one collision.

Calibrate the sensor on the bench, describe the encounter, and get the optimal gain, the contact that it leads to, the
margins and the evidence:

    >>> import pretouch as pt
    >>> sensor = pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
    >>> scenario = pt.Scenario(
    ...     admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    ...     obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
    ... )
    >>> objective = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)
    >>> design = pt.design_gain(scenario, sensor, objective, bounds=(-10.0, -0.01))
    >>> round(design.gain, 4)
    -0.7463

Everything that is public is listed in `__all__`; numbers are SI floats or arrays of them.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ._core.public_names import PUBLIC_NAMES

if TYPE_CHECKING:
    from ._core.errors import (
        CalibrationDataError,
        InvalidInputError,
        MissingExtraError,
        OutOfRangeError,
        OutputExistsError,
        PretouchError,
        ResultUnavailableError,
        ScenarioFileError,
        UnitError,
    )
    from .calibration import (
        Calibration,
        CalibrationReport,
        SensorFit,
        fit_sensor,
        rank_models,
        read_calibration,
        read_calibrations,
    )
    from .config import load_scenario
    from .control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
    from .design import (
        AdmittanceDesign,
        Constraint,
        DesignStatus,
        GainDesign,
        HertzImpact,
        Objective,
        ParetoFront,
        PhysicalBound,
        SpringImpact,
        Term,
        design_admittance,
        design_gain,
        excursion_objective,
        pareto_front,
        time_objective,
    )
    from .design.robust import (
        ConditionalValueAtRisk,
        Expected,
        Quantile,
        Required,
        RobustDesign,
        WorstCase,
        design_robust_gain,
    )
    from .letter import LetterReport, Reproduction, reproduce
    from .motion import (
        Admittance,
        ContactGradients,
        ContactResult,
        ContactState,
        ContactStatus,
        Motion,
        Obstacle,
        Plant,
        Reference,
        Scenario,
        find_contact,
        solve_motion,
    )
    from .report import (
        Curve,
        Mark,
        Panel,
        admittance_figure,
        calibration_figure,
        motion_figure,
        outcome_figure,
        panel_figure,
        pareto_figure,
        price_figure,
        robust_figure,
        sensitivity_figure,
        simulation_figure,
        sweep_figure,
        trade_off_figure,
        verdict_figure,
        verdict_gain_figure,
        verdict_run_figure,
        verdict_stability_figure,
        write_design_report,
        write_fit_report,
        write_pareto_report,
        write_robust_report,
        write_simulation_report,
        write_verdict_report,
    )
    from .sensors import (
        CustomSensor,
        ExponentialFirstOrder,
        ExponentialSecondOrder,
        InversePower,
        MittagLeffler,
        Recessed,
        SensorModel,
        Table,
        check_sensor,
    )
    from .simulation import (
        ClosedLoop,
        DampingLimit,
        GainLimit,
        HuntCrossley,
        IdealPlant,
        ImpedancePlant,
        LoopTiming,
        LoopTrace,
        PositionPlant,
        SensorChain,
        SensorPart,
        SimulationResult,
        SpringDamper,
        chain_of_fit,
        gain_limit,
        largest_damping,
        lowest_rate,
        sensor_part,
        simulate,
        timing_of,
    )
    from .sweep import sweep
    from .uncertainty import (
        CorrelatedNormal,
        Empirical,
        Interval,
        Normal,
        TruncatedNormal,
        Uniform,
        parameter_distribution,
        sample_inputs,
    )
    from .verification import SimulatedEncounter, Verdict, VerdictStatus, simulate_encounter, verify_gain

    __version__: str

__all__ = [
    "Admittance",
    "AdmittanceDesign",
    "Calibration",
    "CalibrationDataError",
    "CalibrationReport",
    "ClosedLoop",
    "ConditionalValueAtRisk",
    "Conditioning",
    "Constraint",
    "ContactGradients",
    "ContactResult",
    "ContactState",
    "ContactStatus",
    "Controller",
    "CorrelatedNormal",
    "Curve",
    "CustomSensor",
    "DampingLimit",
    "DesignStatus",
    "Empirical",
    "Expected",
    "ExponentialFirstOrder",
    "ExponentialSecondOrder",
    "GainDesign",
    "GainLimit",
    "HertzImpact",
    "HuntCrossley",
    "IdealPlant",
    "ImpedancePlant",
    "Interval",
    "InvalidInputError",
    "InversePower",
    "LetterReport",
    "LoopTiming",
    "LoopTrace",
    "Mark",
    "MissingExtraError",
    "MittagLeffler",
    "Motion",
    "Normal",
    "Objective",
    "Obstacle",
    "OutOfRangeError",
    "OutputExistsError",
    "Panel",
    "ParetoFront",
    "PhysicalBound",
    "Plant",
    "PositionPlant",
    "PretouchError",
    "Quantile",
    "Recessed",
    "Reference",
    "Reproduction",
    "Required",
    "ResultUnavailableError",
    "RobustDesign",
    "Scenario",
    "ScenarioFileError",
    "SensorChain",
    "SensorFit",
    "SensorModel",
    "SensorPart",
    "SimulatedEncounter",
    "SimulationResult",
    "SpringDamper",
    "SpringImpact",
    "Table",
    "Term",
    "TruncatedNormal",
    "Uniform",
    "UnitError",
    "Verdict",
    "VerdictStatus",
    "VirtualAdmittance",
    "VirtualDamper",
    "WorstCase",
    "admittance_figure",
    "calibration_figure",
    "chain_of_fit",
    "check_sensor",
    "design_admittance",
    "design_gain",
    "design_robust_gain",
    "excursion_objective",
    "find_contact",
    "fit_sensor",
    "gain_limit",
    "largest_damping",
    "load_scenario",
    "lowest_rate",
    "motion_figure",
    "outcome_figure",
    "panel_figure",
    "parameter_distribution",
    "pareto_figure",
    "pareto_front",
    "price_figure",
    "rank_models",
    "read_calibration",
    "read_calibrations",
    "reproduce",
    "robust_figure",
    "sample_inputs",
    "sensitivity_figure",
    "sensor_part",
    "simulate",
    "simulate_encounter",
    "simulation_figure",
    "solve_motion",
    "sweep",
    "sweep_figure",
    "time_objective",
    "timing_of",
    "trade_off_figure",
    "verdict_figure",
    "verdict_gain_figure",
    "verdict_run_figure",
    "verdict_stability_figure",
    "verify_gain",
    "write_design_report",
    "write_fit_report",
    "write_pareto_report",
    "write_robust_report",
    "write_simulation_report",
    "write_verdict_report",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("importlib.metadata").version(__name__)
    for home, names in PUBLIC_NAMES.items():
        if name in names:
            value = getattr(import_module(f"{__name__}.{home}"), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]


class _Front(ModuleType):
    """Keeps `pretouch.sweep` the verb: Python puts a folder that it loads in the place of the same name."""

    def __setattr__(self, name: str, value: object) -> None:
        folder = name == "sweep" and isinstance(value, ModuleType)
        super().__setattr__(name, value.sweep if folder else value)  # type: ignore[attr-defined]


sys.modules[__name__].__class__ = _Front
