"""The one verb of this folder: a scenario file in, a task out."""

from __future__ import annotations

import hashlib
import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pretouch._core.errors import ScenarioFileError
from pretouch._core.units import format_quantity
from pretouch.design.task import Task

from .building import Builder
from .document import read_document
from .reading import read_sections
from .robust import robust_fields
from .schema import LOOP_SECTIONS
from .sensor_sections import CALIBRATION
from .source import ScenarioSource

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport
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
    content, text, data = read_document(path)
    source = ScenarioSource(path=Path(path), text=text, sha256=hashlib.sha256(content).hexdigest())
    sections, mistakes = read_sections(source, data)
    builder = Builder(source, data, sections)
    scenario, objective, constraints = builder.scenario(), builder.objective(), builder.constraints()
    asked = {"impact": builder.made("impact"), **builder.pareto(), **builder.freedom(), **builder.settings("motion")}
    if mistakes + builder.mistakes and CALIBRATION in (builder.values("sensor") or {}):
        raise ScenarioFileError(source.listed(mistakes + builder.mistakes))  # not worth a fit
    sensor, calibration = builder.sensor()
    if sensor is not None and scenario is not None:
        builder.check_range(sensor, scenario, calibration)
    asked |= robust_fields(builder, scenario, sensor, calibration, constraints)
    if any(name in data for name in LOOP_SECTIONS):
        from .loop import loop_fields  # noqa: PLC0415 - the simulation, only for a file with a loop

        asked |= loop_fields(builder, scenario, sensor, calibration)
    mistakes += builder.mistakes
    bounds = builder.values("gain")
    if mistakes or scenario is None or sensor is None or objective is None or bounds is None:
        raise ScenarioFileError(source.listed(mistakes))
    low, high = bounds["bounds"]
    source = replace(source, supported=_supported(sensor, calibration))
    return Task(scenario, sensor, objective, bounds=(low, high), **asked, calibration=calibration, source=source)


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
