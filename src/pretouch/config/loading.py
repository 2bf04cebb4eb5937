"""The one verb of this folder: a scenario file in, a task out."""

from __future__ import annotations

import hashlib
import os
from typing import TYPE_CHECKING, Any

from pretouch._core.errors import ScenarioFileError
from pretouch._core.units import format_quantity
from pretouch.design.task import Task

from .building import Builder
from .document import Document, listed
from .reading import read_sections
from .robust import robust_fields
from .schema import LOOP_SECTIONS
from .sensor_sections import CalibratedSensor
from .source import ScenarioSource

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport
    from pretouch.motion.scenario import Scenario
    from pretouch.sensors import SensorModel

__all__ = ["load_scenario"]


def load_scenario(path: str | os.PathLike[str]) -> Task:
    """Read a scenario file (TOML); docs/scenario-file.md lists its sections and keys.

    A sensor that is given by its calibration is fitted here; the path of the calibration is relative to the file.

    Args:
        path: the file.

    Returns:
        The task that every verb takes: `design_gain(load_scenario(path))`. Where the file has [uncertainty], also
        what `design_robust_gain` needs; with [chain] and [controller] the sampled loop of `verify_gain`.

    Raises:
        ScenarioFileError: the file has mistakes. The message has one sentence for each: line, key, what was found,
            what is expected.

    Examples:
        >>> import pathlib, tempfile
        >>> text = '''
        ... [sensor]
        ... model = "exponential-1"
        ... scale = 0.458
        ... rate = "-61 1/m"
        ... [admittance]
        ... mass = "1 kg"
        ... natural_frequency = "5 rad/s"
        ... [obstacle]
        ... position = "42.2 mm"
        ... velocity = "-0.3 m/s"
        ... [objective]
        ... kind = "excursion"
        ... position_scale = "0.5 m"
        ... velocity_scale = "0.3 m/s"
        ... [gain]
        ... bounds = ["-10 N*s", "-0.01 N*s"]
        ... '''
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = pathlib.Path(folder, "approach.toml")
        ...     _ = file.write_text(text)
        ...     task = load_scenario(file)
        >>> task.scenario.distance, task.bounds
        (0.0422, (-10.0, -0.01))
    """
    document = Document.open(path)
    sections, mistakes = read_sections(document)
    builder = Builder(document, sections)
    scenario, objective, bounds = builder.scenario(), builder.objective(), builder.bounds()
    impact, constraints = builder.impact(), builder.constraints()
    method, horizon = builder.motion()
    natural_frequency, damping_ratio = builder.freedom()
    quantities, choice = builder.pareto()
    if mistakes + builder.mistakes and isinstance(sections.get("sensor"), CalibratedSensor):
        raise ScenarioFileError(listed(document.path, mistakes + builder.mistakes))  # not worth a fit
    sensor, calibration = builder.sensor()
    if sensor is not None and scenario is not None:
        builder.check_range(sensor, scenario, calibration)
    robust = robust_fields(builder, scenario=scenario, sensor=sensor, calibration=calibration, constraints=constraints)
    looped = _loop(builder, scenario, sensor, calibration)
    mistakes += builder.mistakes
    if mistakes or scenario is None or sensor is None or objective is None or bounds is None:
        raise ScenarioFileError(listed(document.path, mistakes))
    return Task(
        scenario,
        sensor,
        objective,
        bounds=bounds,
        impact=impact,
        method=method,
        horizon=horizon,
        natural_frequency=natural_frequency,
        damping_ratio=damping_ratio,
        quantities=quantities,
        choice=choice,
        **robust,
        **looped,
        calibration=calibration,
        source=ScenarioSource(
            path=document.path,
            text=document.text,
            sha256=hashlib.sha256(document.content).hexdigest(),
            supported=_supported(sensor, calibration),
        ),
    )


def _supported(sensor: SensorModel, calibration: CalibrationReport | None) -> str:
    """Say where a calibration supports the curve."""
    if calibration is None:
        return ""
    window, recess = calibration.window, getattr(sensor, "recess", 0.0)
    near, far = (format_quantity(max(d - recess, 0.0), "m") for d in (window.l_min, window.l_max))
    return (
        f"the calibration supports it from {near} ({window.start_reason}) to {far} ({window.end_reason}): calibrate "
        "over more distances, or extend the curve with minimum_distance or maximum_distance"
    )


def _loop(
    builder: Builder, scenario: Scenario | None, sensor: SensorModel | None, calibration: CalibrationReport | None
) -> dict[str, Any]:
    """Build the sampled loop and what is asked of it, where the file says anything of one."""
    if not any(name in builder.document.data for name in LOOP_SECTIONS):
        return {}
    from .loop import loop_fields  # noqa: PLC0415 - the simulation, only for a file with a loop

    return loop_fields(builder, scenario=scenario, sensor=sensor, calibration=calibration)
