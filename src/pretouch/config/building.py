"""From sections to the objects that pretouch computes with; what contradicts itself is placed as a mistake."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

from pretouch._core.errors import InvalidInputError, PretouchError, UnitError
from pretouch.design.constraints import CONSTRAINT_NAMES, Constraint
from pretouch.design.impact import HertzImpact, ImpactModel, SpringImpact
from pretouch.design.objectives import OBSTACLE_SPEED, Objective, Term
from pretouch.motion.admittance import Admittance
from pretouch.motion.scenario import Obstacle, Plant, Reference, Scenario
from pretouch.sensors import Recessed, SensorModel, known_curves
from pretouch.uncertainty.reservations import recess_in_words

from .document import Document, Mistake
from .fitting import FitRequest, OutputValue, fit_sensor_of, read_output
from .objective_sections import CustomObjective
from .placing import place
from .positions import KeyPath
from .schema import (
    DampedAdmittance,
    FrequencyAdmittance,
    GainSection,
    HertzSection,
    MotionSection,
    ParetoSection,
    SpringSection,
)
from .section import Section
from .sensor_sections import CalibratedSensor, SensorSection

if TYPE_CHECKING:
    from pretouch.calibration import CalibrationReport

__all__ = ["Builder"]

T = TypeVar("T")

_FROM_SURFACE = ("minimum_distance", "maximum_distance")
_SHORT: Mapping[str, str] = {
    "position": "displacement",
    "time": "time",
    "velocity": "relative_velocity",
    "force": "impact_force",
}
DEFAULT_QUANTITIES = ("displacement", "relative_velocity")  # L(20)'s two, where a file names nothing
_FREE = ("natural_frequency_bounds", "damping_ratio_bounds")
Bounds = tuple[float, float]
_ROUNDING = 1e-9  # of a distance that is added and taken away again
_PHYSICAL = ("impact_force", "drive_force")


class Builder:
    """Builds the parts of a problem and collects the mistakes on the way; a part with a mistake is None."""

    def __init__(self, document: Document, sections: Mapping[str, Section]) -> None:
        self.document = document
        self.sections = sections
        self.mistakes: list[Mistake] = []

    def refuse(self, path: KeyPath, sentence: str) -> None:
        """Note a mistake at a key."""
        self.mistakes.append(self.document.mistake(path, sentence))

    def attempt(self, section: str, make: Callable[[], T], path: KeyPath = ()) -> T | None:
        """Make an object; note the mistake where that is refused, at a key where that is known."""
        try:
            return make()
        except InvalidInputError as error:
            self.refuse(*((path, str(error)) if path else place(str(error), section)))
            return None

    def sensor(self) -> tuple[SensorModel | None, CalibrationReport | None]:
        """Build the sensor; fit it where the file names a calibration."""
        section = cast("SensorSection | None", self.sections.get("sensor"))
        if section is None:
            return None, None
        if isinstance(section, CalibratedSensor):
            return self._calibrated(section)
        given = section.model_dump(exclude_none=True, exclude={"model", "recess"})
        model = self.document.data["sensor"]["model"]
        if section.recess is None:
            return self.attempt("sensor", lambda: known_curves(foreign=True)[model](**given)), None
        limits = {key: given.pop(key) for key in _FROM_SURFACE if key in given}
        recess = section.recess
        return self.attempt(
            "sensor", lambda: Recessed(sensor=known_curves(foreign=True)[model](**given), recess=recess, **limits)
        ), None

    def _calibrated(self, section: CalibratedSensor) -> tuple[SensorModel | None, CalibrationReport | None]:
        found = self.document.data["sensor"]
        no_object, offset = found.get("no_object"), section.offset
        request = FitRequest(
            path=self.document.path.parent / section.calibration,
            select={key: str(value) for key, value in section.select.items()},
            columns=section.columns,
            labels=None if section.labels is None else tuple(section.labels),
            no_object=None if no_object is None else self._no_object(no_object),
            offset=offset if isinstance(offset, str) else read_output(found["offset"], name="offset"),
            models=(section.model,) if section.model else (),
            saturation=section.saturation
            if isinstance(section.saturation, str)
            else read_output(found["saturation"], name="saturation"),
            near_field_peak=section.near_field_peak,
            floor_sigmas=section.floor_sigmas,
        )
        try:
            sensor, report = fit_sensor_of(request)
        except PretouchError as error:
            path, sentence = place(str(error), "sensor")
            self.refuse(path if path in self.document.lines and len(path) == 2 else ("sensor", "calibration"), sentence)
            return None, None
        given = section.model_dump(include=set(_FROM_SURFACE), exclude_none=True)
        return self.attempt("sensor", lambda: _extended(sensor, section.recess, given)), report

    def _no_object(self, value: float | str) -> OutputValue | Path:
        """Read a no-object level; text that is no quantity is the path of a file with such readings."""
        try:
            return read_output(value, name="no_object")
        except UnitError:
            return self.document.path.parent / str(value)

    def scenario(self) -> Scenario | None:
        """Build the encounter."""
        admittance, obstacle = self._admittance(), self.sections.get("obstacle")
        if admittance is None or obstacle is None:
            return None
        parts: dict[str, Any] = {
            name: kind(**self.sections[name].model_dump())
            for name, kind in (("plant", Plant), ("reference", Reference))
            if name in self.sections
        }
        return self.attempt(
            "obstacle",
            lambda: Scenario(admittance=admittance, obstacle=Obstacle(**obstacle.model_dump()), **parts),
        )

    def _admittance(self) -> Admittance | None:
        section = self.sections.get("admittance")
        if isinstance(section, DampedAdmittance):
            return self.attempt("admittance", lambda: Admittance(**section.model_dump(exclude=set(_FREE))))
        if isinstance(section, FrequencyAdmittance):
            given = section.model_dump(exclude=set(_FREE))
            return self.attempt("admittance", lambda: Admittance.from_natural_frequency(**given))
        return None

    def freedom(self) -> tuple[Bounds | None, Bounds | None]:
        """Build the bounds of natural frequency and damping ratio, where they are free."""
        section = self.sections.get("admittance")
        ends = [getattr(section, key, None) for key in _FREE]
        found = [None if e is None else (float(e[0]), float(e[1])) for e in ends]
        return found[0], found[1]

    def pareto(self) -> tuple[tuple[str, ...], float | None]:
        """Build what is traded, and the choice that is marked."""
        section = self.sections.get("pareto")
        if not isinstance(section, ParetoSection):
            return DEFAULT_QUANTITIES, None
        names = tuple(section.quantities or DEFAULT_QUANTITIES)
        for i, name in enumerate(names):
            self._needs_impact(name, ("pareto", "quantities", i))
        return names, section.choice

    def impact(self) -> ImpactModel | None:
        """Build the impact, where the file has one."""
        section = self.sections.get("impact")
        if isinstance(section, SpringSection):
            return self.attempt("impact", lambda: SpringImpact(**section.model_dump()))
        if isinstance(section, HertzSection):
            return self.attempt("impact", lambda: HertzImpact(**section.model_dump()))
        return None

    def objective(self) -> Objective | None:
        """Build the objective."""
        section, obstacle = self.sections.get("objective"), self.sections.get("obstacle")
        if section is None:
            return None
        still = obstacle is not None and getattr(obstacle, "velocity", None) == 0
        terms = _terms(section)
        for quantity_path, scale_path, term in terms:
            self._needs_impact(term["quantity"], quantity_path)
            if term["scale"] == OBSTACLE_SPEED and still:
                self.refuse(scale_path, 'found "obstacle speed" for an obstacle at rest, expected a quantity in m/s')
        kind = self.document.data["objective"]["kind"]
        return self.attempt("objective", lambda: Objective(terms=tuple(Term(**t) for _, _, t in terms), name=kind))

    def constraints(self) -> tuple[Constraint, ...]:
        """Build the limits."""
        section = self.sections.get("constraints")
        if section is None:
            return ()
        limits = section.model_dump(exclude_none=True)
        for name in limits:
            self._needs_impact(CONSTRAINT_NAMES[name], ("constraints", name))
        return tuple(Constraint(name=name, limit=limit) for name, limit in limits.items())

    def bounds(self) -> tuple[float, float] | None:
        """Build the bounds of the gain."""
        section = self.sections.get("gain")
        return (section.bounds[0], section.bounds[1]) if isinstance(section, GainSection) else None

    def motion(self) -> tuple[str, float]:
        """Build method and horizon."""
        section = self.sections.get("motion", MotionSection())
        return (section.method, section.horizon) if isinstance(section, MotionSection) else ("auto", 600.0)

    def check_range(self, sensor: SensorModel, scenario: Scenario, calibration: CalibrationReport | None) -> None:
        """Refuse an encounter that the sensor cannot follow from its start to contact; name the reason."""
        low, high = sensor.valid_range
        recess = getattr(sensor, "recess", 0.0)
        window = None if calibration is None else calibration.window
        told = "every answer then says first that no data support it there"
        if low > 0:
            cause, extending = "", 'extend the curve with minimum_distance = "0 mm" where the model allows it'
            if window is not None and window.l_min >= recess + low * (1 - _ROUNDING):
                cause = f", where the calibration supports it ({window.start_reason})"
                extending = f"calibrate nearer, or {extending} (a table does not): {told}"
            self.refuse(
                ("sensor",),
                f"found a valid range that starts {1e3 * low:.4g} mm in front of the contact surface{cause}, expected "
                f'it to reach contact: sink the sensor with recess = "{recess_in_words(recess + low)}", or {extending}',
            )
        if scenario.distance > high:
            cause, extending = ", where the valid range of the sensor ends", ""
            if window is not None and window.l_max <= (recess + high) * (1 + _ROUNDING):
                cause = f", where the calibration ceases to support the curve ({window.end_reason})"
                extending = (
                    f", calibrate farther out, or extend the curve with maximum_distance = "
                    f'"{1e3 * scenario.distance:.4g} mm" where the model allows it (a table does not): {told}'
                )
            self.refuse(
                ("obstacle", "position"),
                f"found a distance of {1e3 * scenario.distance:.4g} mm at the start, expected at most "
                f"{1e3 * high:.4g} mm{cause}: start where the object enters it{extending}",
            )

    def _needs_impact(self, quantity: str, path: KeyPath) -> None:
        if quantity in _PHYSICAL and "impact" not in self.document.data:
            self.refuse(
                path, f'found {quantity} without physical properties, expected [impact] with robot_mass = "4 kg"'
            )


def _extended(sensor: SensorModel, recess: float | None, limits: Mapping[str, float]) -> SensorModel:
    """Sink a fitted curve, and extend or cut it to the distances that are asked for, from the contact surface."""
    if recess is None:
        return dataclasses.replace(sensor, **limits)
    low, high = sensor.valid_range
    low = min(low, limits.get("minimum_distance", low))  # whatever the recess, which may be uncertain
    high = max(high, recess + limits.get("maximum_distance", -math.inf))
    curve = dataclasses.replace(sensor, minimum_distance=low, maximum_distance=high)
    return Recessed(sensor=curve, recess=recess, **limits)


def _terms(section: Section) -> list[tuple[KeyPath, KeyPath, dict[str, Any]]]:
    """Lay out the terms of an objective, each with the keys that its quantity and its scale come from."""
    if isinstance(section, CustomObjective):
        entries: list[KeyPath] = [("objective", "terms", i) for i in range(len(section.terms))]
        dumped = (term.model_dump() for term in section.terms)
        return [((*e, "quantity"), (*e, "scale"), term) for e, term in zip(entries, dumped, strict=True)]
    given = section.model_dump(exclude_none=True)
    return [
        (("objective", f"{kind}_scale"),) * 2
        + ({"quantity": quantity, "scale": given[f"{kind}_scale"], "weight": given[f"{kind}_weight"]},)
        for kind, quantity in _SHORT.items()
        if f"{kind}_scale" in given
    ]
