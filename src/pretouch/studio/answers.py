"""Answer requests of the browser page of `pretouch studio`.

The requests read scenarios, fit curves, sample uncertain encounters and simulate runs.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pretouch._core.errors import InvalidInputError, PretouchError
from pretouch._core.files import plain

from .curves import describe_curve
from .opened_files import OpenedFiles, change_text

if TYPE_CHECKING:
    from pretouch.calibration import Calibration, SensorFit
    from pretouch.designs import Task
    from pretouch.uncertainty import Reservations

SECTIONS: Final = (
    *("sensor", "admittance", "obstacle", "plant", "reference", "objective", "gain", "law", "constraints"),
)
"""The sections whose values the page shows."""

_MODELS: Final = ("inverse-power", "exponential-1", "exponential-2")
LIMITS: Final = ("excursion", "relative_velocity", "acceleration", "virtual_force")
"""The limits that the page computes."""

_SAMPLES: Final = 300
_POINTS: Final = 160
_MOST: Final = 4000  # readings that are drawn


def describe_scenario(files: OpenedFiles, text: str) -> dict[str, Any]:
    """Read a scenario file for the studio page.

    The values are texts with units.

    Args:
        files: the opened files.
        text: the text of the scenario file (TOML).

    Returns:
        `fields`, the values by `section.key`; `fixed`, the sensor curve and the terms of objective and limits that only
        Python can compute; `notes`, sentences on parts of the scenario that the page ignores; `sections`, whether three
        optional sections exist.
    """
    task = files.load(text)
    document = tomllib.loads(text)
    fields = dict(texts_of(document))
    fixed, notes = _fixed(task, document)
    if task.drag_effect is not None and "law.ratio" not in fields:
        fields["law.ratio"] = ratio_of_drag(task)
        notes.append("law: the page chooses a drag by its ratio; this ratio meets the requirement of the file")
    sections = {name: name in document for name in ("uncertainty", "chain", "controller")}
    return {"fields": fields, "fixed": fixed, "notes": notes, "sections": sections}


def ratio_of_drag(task: Task) -> str:
    """Return contact speed divided by approach speed for a virtual drag.

    The drag has the effect that the task requires.
    """
    from pretouch.designs import design_drag  # noqa: PLC0415

    contact = design_drag(task).result.contact
    return f"{contact.relative_velocity / task.scenario.relative_velocity:.6g}"


def texts_of(document: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the values of a scenario as texts for the page.

    Some values are lists of texts.
    """
    for section in SECTIONS:
        for key, value in document.get(section, {}).items():
            if isinstance(value, list) and not any(isinstance(part, dict) for part in value):
                yield f"{section}.{key}", [str(part) for part in value]
            elif isinstance(value, str | int | float) and not isinstance(value, bool):
                yield f"{section}.{key}", str(value)


def _fixed(task: Task, document: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Return the parts of a scenario that only Python can compute. Notes describe the parts that the page ignores."""
    from pretouch.designs.problem import GainProblem  # noqa: PLC0415
    from pretouch.designs.search import GainAxis  # noqa: PLC0415
    from pretouch.designs.search.compiled import limit_rows, supported_terms  # noqa: PLC0415

    fixed: dict[str, Any] = {}
    notes: list[str] = []
    if document["sensor"].get("model") not in _MODELS or "calibration" in document["sensor"]:
        fixed["sensor"] = describe_curve(task.sensor, float(task.scenario.distance))
    if task.scenario.obstacle.course:
        notes.append("obstacle: the page ignores the course of the object; simulate it on the loop")
    if task.drag_effect is not None or task.bounds is None:
        return fixed, notes
    problem = GainProblem(task=task, axis=GainAxis.between(task.bounds, task.law.number))
    objective = document["objective"]
    if objective.get("kind") not in {"excursion", "time"} or "force_scale" in objective:
        terms = supported_terms(problem)
        if terms is None:
            notes.append("objective: the search of the page cannot compute this objective; run pretouch design")
        fixed["terms"] = [[float(x) for x in row] for row in terms or ()]
    others = [c for c in task.limits if c.name not in LIMITS]
    rows = limit_rows(problem, others)
    if rows is None:
        notes.append("constraints: the search of the page cannot compute some constraints; run pretouch design")
    fixed["limits"] = [[float(x) for x in row] for row in rows or ()]
    return fixed, notes


def change_scenario(text: str, changes: dict[str, Any]) -> dict[str, Any]:
    """Change keys in the text of a scenario file.

    Returns:
        The changed text; comments are preserved.
    """
    return {"text": change_text(text, changes)}


def read_readings(files: OpenedFiles, name: str) -> dict[str, Any]:
    """Read an uploaded calibration file, and fit the best sensor curve.

    Returns:
        The readings and the curve, which is fitted in their usable range.
    """
    from pretouch.calibration import read_calibration  # noqa: PLC0415 - SciPy, only when needed

    calibration = read_calibration(files.file(name))
    some = np.linspace(0, len(calibration.distances) - 1, min(len(calibration.distances), _MOST)).astype(int)
    return {
        "name": name,
        "unit": calibration.unit,
        "distances": calibration.distances[some].tolist(),
        "outputs": calibration.outputs[some].tolist(),
        "fit": fit_readings(files, name, None),
    }


def fit_readings(files: OpenedFiles, name: str, window: tuple[float, float] | None) -> dict[str, Any]:
    """Fit the best sensor curve to readings within a distance window.

    Returns:
        The fitted curve. Without a window [m], it is fitted in the usable range.
    """
    from pretouch.calibration import fit, read_calibration  # noqa: PLC0415

    calibration = read_calibration(files.file(name))
    if window is not None:
        calibration = _cut(calibration, *window)
    report = fit(calibration, ("inverse-power", "exponential-1", "exponential-2"))
    if report.best is None:
        return {"verdict": report.verdict, "reasons": list(report.reasons)}
    return _fit_as_dict(report.best, report.verdict)


def _cut(calibration: Calibration, near: float, far: float) -> Calibration:
    """Return the calibration readings between two distances [m]."""
    from pretouch.calibration import Calibration as Readings  # noqa: PLC0415

    inside = (calibration.distances >= near - 1e-12) & (calibration.distances <= far + 1e-12)
    if np.unique(calibration.distances[inside]).size < 3:
        raise InvalidInputError(
            f"window: found {np.unique(calibration.distances[inside]).size} different measured distances, expected at "
            f"least 3. The distance window is {1e3 * near:.4g} mm to {1e3 * far:.4g} mm. Choose a wider window"
        )
    return Readings(
        distances=calibration.distances[inside],
        outputs=calibration.outputs[inside],
        unit=calibration.unit,
        no_object=calibration.no_object,
    )


def _fit_as_dict(fit: SensorFit, verdict: str) -> dict[str, Any]:
    """Return the data of a fit's drawing and the scenario keys of its curve for the page."""
    from pretouch.config.sensor import parameter_texts  # noqa: PLC0415

    sensor, window = fit.sensor, fit.window
    drawn = np.linspace(window.l_min, window.l_max, _POINTS)
    fields = {f"sensor.{name}": text for name, text in parameter_texts(sensor).items()}
    largest = f"{sensor.valid_range[1]!r} m"
    return {
        "verdict": verdict,
        "model": fit.model,
        "window": [window.l_min, window.l_max],
        "start_reason": window.start_reason,
        "end_reason": window.end_reason,
        "offset": {"value": fit.offset.value, "low": fit.offset.low, "high": fit.offset.high, "kind": fit.offset.kind},
        "slope": {"value": fit.middle_slope.value, "low": fit.middle_slope.low, "high": fit.middle_slope.high},
        "rmse": fit.rmse_log_output,
        "curve": [drawn.tolist(), (fit.offset.value + np.asarray(sensor.output(drawn))).tolist()],
        "residuals": [fit.distances.tolist(), fit.residuals.tolist()],
        "warnings": list(fit.warnings),
        "fields": {"sensor.model": fit.model, **fields, "sensor.maximum_distance": largest},
        "starts_at": window.l_min,
    }


def sample_cloud(files: OpenedFiles, text: str, gain: float) -> dict[str, Any]:
    """Solve encounters for one gain with random values of uncertain inputs.

    Returns:
        Contact speed [m/s] and largest excursion [m] of each encounter, and the share of encounters that meets each
        limit.

    Raises:
        InvalidInputError: the scenario has no uncertain inputs.
    """
    from pretouch.uncertainty import sample_inputs  # noqa: PLC0415
    from pretouch.uncertainty.ensemble import make_ensemble  # noqa: PLC0415

    task = files.load(text)
    if not task.uncertainty:
        raise InvalidInputError(
            "uncertainty: the scenario has no uncertain inputs; add a section [uncertainty] with, for example, "
            'obstacle.velocity = { normal = ["-0.3 m/s", "0.1 m/s"], between = ["-0.6 m/s", "-0.05 m/s"] }'
        )
    values = task.from_detection(sample_inputs(task.uncertainty, _SAMPLES, seed=task.robust.seed))
    ensemble = make_ensemble(task.scenario, task.sensor, values, method=task.method, horizon=task.horizon, law=task.law)
    result = ensemble.contacts(gain)
    reached = np.asarray(result.reached)
    speeds = np.where(reached, np.abs(np.asarray(result.end.relative_velocity)), math.nan)
    excursions = np.where(reached, np.asarray(result.end.largest_excursion), math.nan)
    shares = {"contact": float(reached.mean())}
    for limit in task.limits:
        column = {"excursion": excursions, "relative_velocity": speeds}.get(limit.name)
        if column is not None:
            shares[limit.name] = float((column <= limit.limit).mean())
    content: dict[str, Any] = plain({"speed": speeds, "excursion": excursions, "shares": shares, "count": _SAMPLES})
    return content


def describe_reservations(files: OpenedFiles, text: str, gain: float) -> dict[str, Any]:
    """Find out which contact speeds the readings of the calibration allow for one gain.

    Returns:
        `headline`, a warning that precedes the result, and `spread`, the range of speeds that follows it, both in the
        words of `pretouch design`; each is None if there is no reason for it.
    """
    found = reservations_at(files.load(text), gain)
    return {name: None if found is None else getattr(found, name) for name in ("headline", "spread")}


def reservations_at(task: Task, gain: float | None) -> Reservations | None:
    """Return the warnings about the calibration of a scenario for one gain; None without a calibration."""
    from pretouch.uncertainty import reservations_of  # noqa: PLC0415

    if task.calibration is None:
        return None
    return reservations_of(task.calibration, task.replace(gain=gain), subtracted=task.subtracted_offset)


def simulate_run(files: OpenedFiles, text: str, gain: float | None, seed: int | None = None) -> dict[str, Any]:
    """Simulate one encounter with a sampled controller and sensor noise.

    Returns:
        The motion until contact.

    Raises:
        InvalidInputError: the scenario does not describe the sampled loop.
    """
    from dataclasses import replace  # noqa: PLC0415

    from pretouch.verification import simulate  # noqa: PLC0415

    task = files.load(text)
    if task.loop is None:
        raise InvalidInputError(
            "loop: the scenario does not describe the sampled loop; add the sections [chain] and [controller], such as "
            "those of examples/loop.toml"
        )
    loop = task.loop if seed is None else replace(task.loop, seed=seed)
    encounter = simulate(task.replace(loop=loop, gain=task.gain if gain is None else gain))
    trace, reference = encounter.trace, task.scenario.reference
    end = trace.contacts[0, 0] if len(trace.contacts) else trace.time[-1]
    before = np.flatnonzero(trace.time <= end)
    some = before[np.unique(np.linspace(0, len(before) - 1, min(len(before), 4 * _POINTS)).astype(int))]
    own = reference.position + (reference.velocity + reference.acceleration * trace.time / 2) * trace.time
    columns = {
        "time": trace.time,
        "distance": trace.distance,
        "relative_velocity": np.gradient(trace.distance, trace.time),
        "displacement": trace.position - own,
        "virtual_force": trace.virtual_force,
    }
    content: dict[str, Any] = plain({name: np.asarray(values)[some] for name, values in columns.items()})
    found, headline = reservations_at(task, encounter.gain), encounter.headline
    if found is not None:
        headline = " ".join(filter(None, [found.headline, found.with_spread(headline)]))
    return {**content, "headline": headline, "warnings": list(encounter.warnings)}


def message_of(error: PretouchError, folder: Path) -> str:
    """Return the message of an error for the page.

    The name of the temporary folder is removed.
    """
    return str(error).replace(f"{folder}/", "").replace("upload-", "")
