"""Load scenario files and create design tasks from them.

A scenario file is TOML with units. It is checked against a schema.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
import os
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import CalibrationDataError, PretouchError
from pretouch._core.units import format_quantity
from pretouch._core.vocabulary import QUANTITIES
from pretouch._core.warning_codes import codes_in
from pretouch.designs.constraints import Constraint
from pretouch.designs.custom_objectives import AnyObjective
from pretouch.designs.objectives import OBSTACLE_SPEED, Objective, Term
from pretouch.designs.quantities import CONSTRAINT_NAMES
from pretouch.designs.task import Task
from pretouch.motion.scenario import Scenario
from pretouch.sensors import Recessed, SensorModel
from pretouch.uncertainty.reservations import recess_advice

from .document import read_document
from .quantities import KeyPath
from .reading import Reading, ScenarioSource, split_message
from .robot import check_tracking, project_robot
from .robot_section import has_model
from .robust import robust_fields
from .schema import FREE, LOOP_SECTIONS, OBJECTIVE_VARIANTS, OPTIONS
from .sensor import CALIBRATION, FROM_SURFACE, FitRequest, fit_sensor_of, read_no_object, read_output

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport
    from pretouch.designs.impact import ImpactModel
    from pretouch.robots import Projection

_QUANTITY_OF_SCALE: Final[Mapping[str, str]] = {
    "position": "displacement",
    "time": "time",
    "velocity": "relative_velocity",
    "force": "impact_force",
}
FASTEST: Final = 10_000.0  # rad/s, largest natural frequency of an admittance
STEEPEST: Final = 1e-6  # m, smallest plausible distance over which the output falls by a factor of e
_ROUNDING: Final = 1e-9  # relative error of a distance after adding and subtracting the recess


@check_arguments
def load_scenario(path: str | os.PathLike[str]) -> Task:
    """Read a design task from a scenario file in TOML.

    docs/reference/scenario-file.md lists the sections and keys of a scenario file.

    If [sensor] names a calibration file, this function fits the sensor curve. The path of a calibration file is
    relative to the scenario file.

    Args:
        path: the file.

    Returns:
        The task, for example for `design(load_scenario(path))`. With [uncertainty], it also has the
        distributions for `robust`; with [chain] and [controller], the sampled loop for `verify`.

    Raises:
        ScenarioFileError: the file has mistakes. The message has a sentence for each: line, key, value, and what is
            expected.

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
    """  # noqa: DOC502 - raised by the functions below
    content, text, data = read_document(path)
    return load_document(Path(path), text, hashlib.sha256(content).hexdigest(), data)


def load_document(path: Path, text: str, sha256: str, data: Mapping[str, Any]) -> Task:
    """Create the design task from a parsed scenario file.

    Args:
        path: the file, to whose folder paths in the file are relative.
        text: the content of the file, which messages and reports show.
        sha256: its hash.
        data: the parsed content.

    Returns:
        The task.
    """
    source = ScenarioSource(path=path, text=text, sha256=sha256)
    builder = _Builder(source, data)
    task = _task(builder)
    if task is None:
        raise source.refusal(builder.unread + builder.mistakes)
    return task


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationPlan:
    """The calibration required by a scenario file.

    The calibration must cover the distances from `nearest` to `farthest`.

    Args:
        path: the calibration file, which need not exist.
        nearest: distance of the sensor from the object at contact [m].
        farthest: distance of the sensor from the object at the start [m].
    """

    path: Path
    nearest: float
    farthest: float


def load_calibration_plan(path: str | os.PathLike[str]) -> CalibrationPlan:
    """Return the calibration path and distances that a scenario file requires.

    The calibration must be recorded at all distances of the encounter.

    Args:
        path: the scenario file.

    Returns:
        The path of the calibration, and the distances of the encounter.

    Raises:
        ScenarioFileError: the file has mistakes, or its sensor needs no calibration file.
    """  # noqa: DOC502 - made by refusal
    content, text, data = read_document(path)
    source = ScenarioSource(path=Path(path), text=text, sha256=hashlib.sha256(content).hexdigest())
    builder = _Builder(source, data)
    scenario, sensor = builder.scenario(), builder.values("sensor")
    builder.objective()
    builder.constraints()
    if sensor is not None and CALIBRATION not in sensor:
        builder.refuse(
            ("sensor",),
            "found no calibration file, expected one to record; replace the keys of the curve by "
            'calibration = "sensor.csv"',
        )
    if builder.unread or builder.mistakes or scenario is None or sensor is None:
        raise source.refusal(builder.unread + builder.mistakes)
    recess = sensor.get("recess") or 0.0
    farthest = recess + float(np.max(scenario.distance))
    return CalibrationPlan(path=source.path.parent / sensor[CALIBRATION], nearest=recess, farthest=farthest)


def _task(builder: _Builder) -> Task | None:
    """Return the design task of a scenario file. The result is None if the file contains mistakes."""
    scenario, objective, constraints = builder.scenario(), builder.objective(), builder.constraints()
    options = {**builder.admittance_bounds(), **builder.settings("motion")}
    options |= {section: builder.options(section) for section in OPTIONS}
    builder.check_impact_of_front()
    if (builder.unread or builder.mistakes) and CALIBRATION in (builder.values("sensor") or {}):
        return None  # with mistakes, a fit would be wasted time
    projection = project_robot(builder)
    check_tracking(builder)
    options["impact"] = builder.impact(projection)
    sensor, calibration = builder.sensor()
    builder.check_frequencies(scenario)
    if sensor is not None and scenario is not None:
        builder.check_slope(sensor)
        builder.check_range(sensor, scenario, calibration)
    options |= robust_fields(builder, scenario, sensor, calibration, constraints)
    has_loop = any(name in builder.data for name in LOOP_SECTIONS if name != "robot" or not has_model(builder.data))
    if has_loop:
        from .loop import loop_fields  # noqa: PLC0415 - the simulation, only for a file with a loop

        options |= loop_fields(builder, scenario, sensor, calibration)
    if "law" in builder.data:
        from .law import law_fields  # noqa: PLC0415 - the sampled drag, only for a file that names a law

        builder.check_impact_of_drag()
        options |= law_fields(builder, scenario, options["uncertainty"], has_loop)
    if builder.unread or builder.mistakes or scenario is None or sensor is None:
        return None
    if "gain" in builder.sections:
        low, high = builder.sections["gain"][1]["bounds"]
        options["bounds"] = (low, high)
    source = replace(builder.source, supported=_supported(sensor, calibration))
    task = Task(scenario, sensor, objective, **options, calibration=calibration, source=source)
    return task if projection is None else builder.attempt("robot", lambda: projection.apply(task))


def _supported(sensor: SensorModel, calibration: CalibrationReport | None) -> str:
    """Describe the range of calibrated distances in one sentence. The text is empty without a calibration."""
    if calibration is None:
        return ""
    window, recess = calibration.window, getattr(sensor, "recess", 0.0)
    near, far = (format_quantity(max(d - recess, 0.0), "m") for d in (window.l_min, window.l_max))
    return (
        f"the calibration covers only distances from {near} to {far}. Reason for the lower limit: "
        f"{window.start_reason}. Reason for the upper limit: {window.end_reason}. Calibrate over more distances, or "
        "extend the curve with minimum_distance or maximum_distance"
    )


class _Builder(Reading):
    """Builder of a task from the sections of a file; the method of a section with a mistake returns None."""

    def sensor(self) -> tuple[SensorModel | None, CalibrationReport | None]:
        """Build or fit the sensor curve of the scenario file."""
        values = self.values("sensor")
        if values is None:
            return None, None
        if CALIBRATION in values:
            return self._calibrated(values)
        if "recess" not in values:
            return self.make("sensor"), None
        limits = {key: values[key] for key in FROM_SURFACE if key in values}
        curve: Any = self.sections["sensor"][0].make
        parameters = {key: value for key, value in values.items() if key not in {"recess", *FROM_SURFACE}}
        return (
            self.attempt("sensor", lambda: Recessed(sensor=curve(**parameters), recess=values["recess"], **limits)),
            None,
        )

    def _calibrated(self, values: Mapping[str, Any]) -> tuple[SensorModel | None, CalibrationReport | None]:
        """Fit the sensor curve to the calibration file."""
        data, folder = self.data["sensor"], self.source.path.parent
        outputs: dict[str, Any] = {
            key: values[key] if isinstance(values[key], str) else read_output(data[key], name=key)
            for key in ("offset", "saturation")
        }
        path = folder / values[CALIBRATION]
        try:
            unchanged = ("select", "columns", "labels", "near_field_peak", "floor_sigmas")
            request = FitRequest(
                path=path,
                models=(values["model"],) if "model" in values else (),
                no_object=read_no_object(data["no_object"], folder, name="no_object") if "no_object" in data else None,
                **{key: values[key] for key in unchanged if key in values},
                **outputs,
            )
            self.source = replace(self.source, calibration_files=request.files)
            sensor, report = fit_sensor_of(request)
        except PretouchError as error:
            key, sentence = split_message(_without_content(error, path), "sensor")
            is_key = key in self.source.lines and len(key) == 2
            self.refuse(key if is_key else ("sensor", CALIBRATION), sentence)
            return None, None
        limits = {key: values[key] for key in FROM_SURFACE if key in values}
        return self.attempt("sensor", lambda: _extend(sensor, values.get("recess"), limits)), report

    def scenario(self) -> Scenario | None:
        """Build the encounter from the scenario file."""
        parts = {
            name: self.make(name, tuple(FREE))
            for name in ("admittance", "obstacle", "plant", "reference")
            if name in self.sections
        }
        if any(part is None for part in parts.values()) or not {"admittance", "obstacle"} <= set(parts):
            return None
        return self.attempt("obstacle", lambda: Scenario(**parts))

    def admittance_bounds(self) -> dict[str, tuple[float, float]]:
        """Return the bounds of natural frequency and damping ratio.

        The result is empty if the scenario file has no such bounds.
        """
        values = self.values("admittance") or {}
        return {key.removesuffix("_bounds"): (values[key][0], values[key][1]) for key in FREE if key in values}

    def objective(self) -> AnyObjective | None:
        """Build the objective from the section [objective] of the scenario file."""
        values = self.values("objective")
        if values is None:
            return None
        kind = self.data["objective"]["kind"]
        if kind not in OBJECTIVE_VARIANTS:
            extension: AnyObjective | None = self.make("objective")
            return extension
        at_rest = (self.values("obstacle") or {}).get("velocity") == 0
        terms = list(_terms(values))
        for quantity_path, scale_path, term in terms:
            self._check_impact(term["quantity"], quantity_path)
            if term["scale"] == OBSTACLE_SPEED and at_rest:
                self.refuse(scale_path, 'found "obstacle speed" for an obstacle at rest, expected a quantity in m/s')
        return self.attempt("objective", lambda: Objective(terms=tuple(Term(**t) for _, _, t in terms), name=kind))

    def constraints(self) -> tuple[Constraint, ...]:
        """Build the constraints from the section [constraints] of the scenario file."""
        limits = self.values("constraints") or {}
        for name in limits:
            self._check_impact(CONSTRAINT_NAMES[name], ("constraints", name))
        return tuple(Constraint(name=name, limit=limit) for name, limit in limits.items())

    def impact(self, projection: Projection | None) -> ImpactModel | None:
        """Build the impact model; the default robot mass is the reflected mass of the robot model."""
        values = self.values("impact")
        if values is None:
            return None
        variant, name = self.sections["impact"][0], "robot_mass"
        if name not in values and projection is None:
            if not has_model(self.data):  # otherwise, the model has a mistake
                self.refuse(("impact", name), variant.keys[name].missing(name))
            return None
        masses = {} if projection is None else {name: projection.reflected_mass}
        return self.attempt("impact", lambda: variant.make(**masses | values))  # type: ignore[misc]

    def check_impact_of_front(self) -> None:
        """Require the section [impact] for a Pareto front of impact forces."""
        for i, name in enumerate((self.values("pareto") or {}).get("quantities", ())):
            self._check_impact(name, ("pareto", "quantities", i))

    def check_impact_of_drag(self) -> None:
        """Require the section [impact] for the key impact_force of [law]."""
        if "impact_force" in (self.values("law") or {}):
            self._check_impact("impact_force", ("law", "impact_force"))

    def check_range(self, sensor: SensorModel, scenario: Scenario, calibration: CalibrationReport | None) -> None:
        """Check that the encounter lies within the sensor's distance range."""
        low, high = sensor.valid_range
        recess = getattr(sensor, "recess", 0.0)
        window = None if calibration is None else calibration.window
        if low > 0:
            cause, other = "", 'extend the curve with minimum_distance = "0 mm" (not for a table)'
            if window is not None and window.l_min >= recess + low * (1 - _ROUNDING):
                cause, other = f" ({window.start_reason.partition(' (')[0]})", "calibrate with lower amplification"
                if calibration is not None and "PT117" in codes_in((*calibration.reasons, *calibration.notes)):
                    other = f"repeat the nearest readings (PT117), or {other}"
            start = f"{1e3 * low:.4g} mm{cause}"
            self.refuse(
                ("sensor",),
                f"the sensor curve starts at the distance {start}, but must reach contact. Remedy: "
                f"{recess_advice(recess + low, recess)}, or {other}",
            )
        if scenario.distance > high:
            cause, extending = ", the end of the sensor's valid range", ""
            if window is not None and window.l_max <= (recess + high) * (1 + _ROUNDING):
                cause = f", the end of the calibrated range ({window.end_reason})"
                extending = (
                    " Alternatively, calibrate at larger distances. To extrapolate a curve that is not a table, set "
                    f'maximum_distance = "{1e3 * scenario.distance:.4g} mm". Every result then begins with a '
                    "warning about the extrapolation."
                )
            end = f"{1e3 * high:.4g} mm{cause}"
            self.refuse(
                ("obstacle", "position"),
                f"the encounter starts at a distance of {1e3 * scenario.distance:.4g} mm, but the sensor "
                f"curve ends at a distance of {end}. Start the encounter at a smaller distance.{extending}",
            )

    def check_frequencies(self, scenario: Scenario | None) -> None:
        """Check that the admittance's natural frequency is not too high.

        Control loops have a limited rate.
        """
        values = self.values("admittance") or {}
        frequencies = {key: values[key][1] for key in FREE if key == "natural_frequency_bounds" and key in values}
        if scenario is not None:
            key = next((k for k in ("natural_frequency", "stiffness") if values.get(k) is not None), "stiffness")
            frequencies[key] = scenario.admittance.natural_frequency
        for key, frequency in frequencies.items():
            if frequency > FASTEST:
                self.refuse(
                    ("admittance", key),
                    f"the natural frequency of {frequency:.4g} rad/s is too high, because no control loop is "
                    f"faster than {FASTEST:,.0f} rad/s. Check mass and stiffness with their units",
                )

    def check_slope(self, sensor: SensorModel) -> None:
        """Check that the sensor curve is not implausibly steep.

        The slope is checked at contact. An implausible curve falls by a factor of e within less than a micrometer.
        """
        nearest = max(sensor.valid_range[0], 0.0)
        slope = abs(float(sensor.log_slope(nearest)))
        if slope > 1 / STEEPEST:
            self.refuse(
                ("sensor",),
                f"the sensor curve is too steep at the distance {nearest:g} m. There, the output falls by a factor of "
                f"e (2.718) within a length of {1 / slope:.3g} m, expected at least {STEEPEST:g} m. Check the "
                "parameters of the curve and their units",
            )

    def _check_impact(self, quantity: str, path: KeyPath) -> None:
        if QUANTITIES[quantity].needs_impact and "impact" not in self.data:
            self.refuse(
                path,
                f"the quantity {quantity} needs the section [impact] of the scenario file; add this section, for "
                'example with robot_mass = "4 kg"',
            )


def _without_content(error: PretouchError, path: Path) -> str:
    """Return an error message that does not quote the calibration file.

    A scenario may name any file, so the message must not reveal the content of that file. If the mistake is not in the
    calibration file, the message names the key of [sensor] with the mistake.
    """
    if not isinstance(error, CalibrationDataError):
        return str(error)
    key = str(error).partition(": ")[0]
    if key in {"columns", "labels"}:
        problem = error.problem or f"{key}: found {key} that do not fit {path.name}"
    else:
        problem = error.problem or f"{path.name}: found no calibration that can be read"
    return problem if problem == str(error) else f"{problem}; to see more, run: pretouch fit {shlex.quote(str(path))}"


def _extend(sensor: SensorModel, recess: float | None, limits: Mapping[str, float]) -> SensorModel:
    """Extend or cut a fitted sensor curve to requested distances. A recess of the sensor shifts the curve."""
    if recess is None:
        return dataclasses.replace(sensor, **limits)
    low, high = sensor.valid_range
    low = min(low, limits.get("minimum_distance", low))  # does not depend on the recess, which may be uncertain
    high = max(high, recess + limits.get("maximum_distance", -math.inf))
    curve = dataclasses.replace(sensor, minimum_distance=low, maximum_distance=high)
    return Recessed(sensor=curve, recess=recess, **limits)


def _terms(values: Mapping[str, Any]) -> Iterator[tuple[KeyPath, KeyPath, dict[str, Any]]]:
    """Yield each term of an objective with the keys of its quantity and of its scale."""
    for i, term in enumerate(values.get("terms", ())):
        path: KeyPath = ("objective", "terms", i)
        yield (*path, "quantity"), (*path, "scale"), term
    for kind, quantity in _QUANTITY_OF_SCALE.items():
        if f"{kind}_scale" in values:
            path = ("objective", f"{kind}_scale")
            yield path, path, {"quantity": quantity, "scale": values[path[1]], "weight": values[f"{kind}_weight"]}
