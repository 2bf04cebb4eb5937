"""Create or fit the sensor curve of a scenario file.

The section `[sensor]` gives the parameters of the curve or a calibration.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from pretouch._core.errors import CalibrationDataError, InvalidInputError, PretouchError, UnitError
from pretouch._core.units import read_quantity
from pretouch.sensors import SensorModel, sensor_curves
from pretouch.sensors.registry import CURVE_KINDS, find_curve

from .quantities import Quantity, UnfitValueError, output_unit, value_text
from .section import LENGTH, REQUIRED, TAG, Key, Section, checked, declared_keys, list_of, one_of, text

if TYPE_CHECKING:
    from pretouch.calibration import Calibration, CalibrationReport


CALIBRATION: Final = "calibration"
FROM_SURFACE: Final = ("minimum_distance", "maximum_distance")
_OUTPUT: Final = Quantity("output", "0.12")
_AUTO_OR_NONE: Final = ("auto", "none")
_GEOMETRY: Final = {
    "recess": Key(Quantity("m", '"2 mm"', "nonnegative")),
    "minimum_distance": Key(LENGTH),
    "maximum_distance": Key(Quantity("m", '"0.1 m"', infinite=True)),
}
"""The keys of every sensor; distances are measured from the contact surface, except `recess`."""


def section_of_curve(curve: type[SensorModel]) -> Section:
    """Return a description of a sensor curve's scenario-file section.

    Its keys are the parameters or points of the curve.
    """
    points = {f.name: _points(f.metadata["points"]) for f in fields(curve) if "points" in f.metadata}
    return Section({**_GEOMETRY, **declared_keys(curve), "model": TAG, **points}, make=curve)


def sensor_variants(*, foreign: bool = False) -> dict[str, Section]:
    """Return the variants of the section [sensor].

    There is one variant for each sensor curve, and one for a calibration.
    """
    return {name: section_of_curve(curve) for name, curve in sensor_curves(foreign=foreign).items()} | {
        CALIBRATION: _CALIBRATED
    }


def parameter_texts(sensor: SensorModel) -> dict[str, str]:
    """Return the parameters of a sensor curve as texts with units."""
    units = sensor.parameter_units
    return {name: f"{float(value)!r} {units[name]}".strip() for name, value in sensor.parameters.items()}


def keys_of_curve(sensor: SensorModel) -> dict[str, Any]:
    """Return the keys of the section [sensor] that describe a fitted curve without its calibration."""
    curve, recess = sensor.bare
    geometry = {"recess": f"{recess!r} m"} if recess else {}
    farthest = f"{float(sensor.valid_range[1])!r} m"
    return {"model": curve.name, **parameter_texts(curve), **geometry, "maximum_distance": farthest}


def _points(unit: str) -> Key:
    """Make the key for a list of distances or outputs."""
    if unit != "output":
        distances = list_of(Quantity(unit), 2, None, f"a list of two or more quantities in {unit}")
        return Key(distances, REQUIRED, '["0 mm", "10 mm", "20 mm"]')
    outputs = list_of(Quantity(unit, sign="positive"), 2, None, "a list of two or more sensor outputs")

    def read(value: Any) -> Any:
        """Parse sensor outputs; raise an error if volts and counts are mixed."""
        if isinstance(value, list) and len({output_unit(v) for v in value if isinstance(v, str)}) > 1:
            raise UnfitValueError("expected outputs of one unit, all in V or all in counts")
        return outputs(value)

    return Key(read, REQUIRED, '["4 V", "2 V", "1 V"]')


def _all_of_type(values: Iterable[Any], *types: type) -> bool:
    return all(type(value) in types for value in values)


def _model(value: Any) -> str:
    try:
        curve = find_curve(value) if isinstance(value, str) else None
    except InvalidInputError as error:
        raise UnfitValueError(f"found {value_text(value)}, but {error}") from None
    if curve is None:
        raise UnfitValueError(one_of(value, CURVE_KINDS.names()))
    return str(value)


def _level_or_file(value: Any) -> float | str:
    """Parse the sensor output without an object. The value may also be the path of a file with such readings."""
    if isinstance(value, str) and re.search(r"\.[A-Za-z]\w*$", value):
        return value
    try:
        return _OUTPUT(value)
    except UnfitValueError as error:
        raise UnfitValueError(f'{error}, or a file such as "dark.csv"') from None


_SELECT: Final = checked(
    lambda v: isinstance(v, Mapping) and _all_of_type(v.values(), str, int, float),
    "a table of label columns, for example { day = 30, sensor = 4 }",
)
_COLUMNS: Final = checked(
    lambda v: isinstance(v, Mapping) and {*v} <= {"distance", "output"} and _all_of_type(v.values(), str, int),
    'a table of distance and output, each a header, a number or a unit, for example { distance = 1, output = "3 [V]" }',
)
_LABELS: Final = checked(
    lambda v: isinstance(v, list) and _all_of_type(v, str, int),
    'a list of headers or numbers of columns, for example ["day", "sensor"]',
)
_CALIBRATED: Final = Section(
    {
        **_GEOMETRY,
        CALIBRATION: Key(text('"sensor.csv"'), REQUIRED),
        "model": Key(_model),
        "select": Key(_SELECT),
        "columns": Key(_COLUMNS),
        "labels": Key(_LABELS),
        "no_object": Key(_level_or_file),
        "offset": Key(Quantity("output", '"auto"', words=("auto", "fit", "zero")), "auto"),
        "saturation": Key(Quantity("output", '"auto"', words=_AUTO_OR_NONE), "auto"),
        "near_field_peak": Key(Quantity("m", '"auto"', "nonnegative", words=_AUTO_OR_NONE), "auto"),
        "floor_sigmas": Key(Quantity("", "3.0", "positive"), 3.0),
    }
)
"""The variant with `calibration = "sensor.csv"`, which is fitted when the scenario file is read."""


OutputValue: TypeAlias = tuple[float, str]
"""A sensor output and its unit: V, counts, or empty for a bare number."""


def read_output(value: float | str, *, name: str) -> OutputValue:
    """Parse a sensor output with or without unit.

    The unit is V or counts.

    Returns:
        The number, in SI, and its unit.

    Raises:
        UnitError: the value is not a sensor output.

    Examples:
        >>> read_output("110 mV", name="offset"), read_output(32, name="offset")
        ((0.11, 'V'), (32.0, ''))
    """
    for unit in ("", "V", "counts"):
        try:
            return read_quantity(value, unit, name=name), unit
        except (UnitError, ArithmeticError):
            continue
    raise UnitError(f'{name}: found {value!r}, expected a number, or a text such as "0.2 V" or "20 counts"')


def read_no_object(value: float | str, folder: Path, *, name: str) -> OutputValue | Path:
    """Parse the sensor output without an object.

    Returns:
        The output and its unit, or the path of a file in `folder` with such readings.

    Raises:
        UnitError: the value is neither of them.
    """
    try:
        return read_output(value, name=name)
    except UnitError:
        path = folder / str(value)
        if path.exists() or path.suffix:
            return path
        raise


@dataclass(frozen=True, slots=True, kw_only=True)
class FitRequest:
    """Options for fitting a sensor curve to a calibration file.

    Args:
        path: the file.
        select: values of label columns; curves with other labels are ignored.
        columns: the columns of distance and output, as for `read_calibration`.
        labels: the label columns; None for all columns except distance and output.
        no_object: a reading without an object, or a file with such readings.
        offset: `auto`, `fit`, `zero`, or the value of the offset.
        saturation: `auto`, `none`, or the output at which the sensor clips.
        near_field_peak: `auto`, `none`, or the distance of the near-field peak [m].
        models: the models to choose from; empty for all.
        floor_sigmas: the noise floor, in standard deviations above the offset.
    """

    path: Path
    select: Mapping[str, str | int | float] = field(default_factory=dict)
    columns: Mapping[str, str | int] = field(default_factory=dict)
    labels: Sequence[str | int] | None = None
    no_object: OutputValue | Path | None = None
    offset: str | OutputValue = "auto"
    saturation: str | OutputValue = "auto"
    near_field_peak: str | float = "auto"
    models: tuple[str, ...] = ()
    floor_sigmas: float = 3.0

    @property
    def files(self) -> tuple[Path, ...]:
        """All files that are read when the sensor curve is fitted."""
        return (self.path, self.no_object) if isinstance(self.no_object, Path) else (self.path,)

    def read(self) -> tuple[Calibration, ...]:
        """Read the calibration curves with the selected labels. An error is raised if no curve matches the labels."""
        from pretouch.calibration import read_calibrations  # noqa: PLC0415 - SciPy, only when needed

        if self.path.suffix.lower() == ".toml":
            raise CalibrationDataError(
                f"{self.path}: this is a scenario file, expected a calibration, a table with distances and outputs; "
                "run pretouch design with a scenario file"
            )
        no_object = self.no_object[0] if isinstance(self.no_object, tuple) else self.no_object
        try:
            curves = read_calibrations(self.path, no_object=no_object, columns=self.columns, labels=self.labels)
        except CalibrationDataError as error:
            if error.problem or not self._is_calibration():
                raise
            raise CalibrationDataError(str(error), problem=str(error)) from None
        selected = {key: str(value) for key, value in self.select.items()}
        matches = tuple(curve for curve in curves if selected.items() <= curve.labels.items())
        if not matches:
            labels = "; ".join(curve.label for curve in curves[:8] if curve.label)
            labels = labels or "none, because the file contains one curve"
            labels += f" and {len(curves) - 8} more" if len(curves) > 8 else ""
            wanted = sorted(f"{key}={value}" for key, value in selected.items())
            message = (
                f"select: the file has no curve with the labels {', '.join(wanted)}; labels available "
                f"in {self.path.name}: {labels}"
            )
            raise CalibrationDataError.without_content(message)  # labels of a valid calibration may be quoted
        if isinstance(self.no_object, tuple):
            _in_unit_of(matches[0], self.no_object, "no_object")
        return matches

    def _is_calibration(self) -> bool:
        """Check whether the file is a readable calibration. Messages may quote the contents of a calibration."""
        from pretouch.calibration import read_calibrations  # noqa: PLC0415 - SciPy, only when needed

        try:
            read_calibrations(self.path)
        except PretouchError:
            return False
        return True

    def rank(self, calibration: Calibration) -> CalibrationReport:
        """Fit all curve models to one calibration and rank the fitted curves."""
        offset, saturation = (
            value if isinstance(value, str) else _in_unit_of(calibration, value, name)
            for name, value in (("offset", self.offset), ("saturation", self.saturation))
        )
        report = _fit(
            calibration,
            self.models,
            offset=offset,
            saturation=None if saturation == "none" else saturation,
            near_field_peak=None if self.near_field_peak == "none" else self.near_field_peak,
            floor_sigmas=self.floor_sigmas,
            curves=tuple(sensor_curves(foreign=True).items()),
        )
        return replace(report, scenario_lines=tuple(self._scenario_lines(calibration, report)))

    def _scenario_lines(self, calibration: Calibration, report: CalibrationReport) -> Iterator[str]:
        """Yield the scenario-file lines that repeat this fit. The lines belong to the section [sensor]."""
        if self.path.is_absolute():  # of this machine, so that the file would be useless on others
            yield f"{CALIBRATION} = {_in_toml(self.path.name)}  # its path from the folder of the scenario file"
        else:
            yield f"{CALIBRATION} = {_in_toml(self.path)}"
        if self.models and report.best is not None:
            yield f"model = {_in_toml(report.best.model)}"
        if self.select:
            yield f"select = {_as_toml(calibration.labels)}"
        if self.columns:
            yield f"columns = {{ {', '.join(f'{key} = {_in_toml(value)}' for key, value in self.columns.items())} }}"
        if self.labels is not None:
            yield f"labels = [{', '.join(map(_in_toml, self.labels))}]"
        peak = self.near_field_peak
        for key, value, default in (
            ("no_object", self.no_object, None),
            ("offset", self.offset, "auto"),
            ("saturation", self.saturation, "auto"),
            ("near_field_peak", peak if isinstance(peak, str) else (peak, "m"), "auto"),
            ("floor_sigmas", self.floor_sigmas, 3.0),
        ):
            if value != default:
                yield f"{key} = {_in_toml(value)}"


@lru_cache(maxsize=8)
def _fit(
    calibration: Calibration,
    models: tuple[str, ...],
    *,
    offset: str | float,
    saturation: float | str | None,
    near_field_peak: float | str | None,
    floor_sigmas: float,
    curves: tuple[tuple[str, type[SensorModel]], ...],  # noqa: ARG001 - a new curve is a new fit
) -> CalibrationReport:
    """Fit the curve models to the readings. One command reads the same calibration up to three times."""
    from pretouch.calibration import fit  # noqa: PLC0415 - SciPy, only when needed

    return fit(
        calibration,
        models or None,
        offset=offset,
        saturation=saturation,
        near_field_peak=near_field_peak,
        floor_sigmas=floor_sigmas,
    )


def _in_toml(value: str | float | OutputValue | Path | None) -> str:
    """Format the value of an option as TOML. A quantity is a number with its unit."""
    if isinstance(value, tuple):
        value = f"{value[0]!r} {value[1]}" if value[1] else value[0]
    if isinstance(value, Path):
        value = value.as_posix()
    return json.dumps(value, ensure_ascii=False)


def _as_toml(labels: Mapping[str, str]) -> str:
    """Return the labels of a calibration curve as a TOML table."""
    texts = (
        f"{key if re.fullmatch(r'[A-Za-z0-9_-]+', key) else json.dumps(key, ensure_ascii=False)} = "
        f"{value if re.fullmatch(r'0|[1-9][0-9]{0,17}', value) else json.dumps(value, ensure_ascii=False)}"
        for key, value in labels.items()
    )
    return f"{{ {', '.join(texts)} }}"


def _in_unit_of(calibration: Calibration, value: OutputValue, name: str) -> float:
    """Return a sensor output in the calibration's unit."""
    number, unit = value
    if unit and unit != calibration.unit:
        expected = calibration.unit or "no unit"
        raise UnitError(
            f"{name}: found {number:g} {unit}, expected a value in the unit of the calibration ({expected})"
        )
    return number


def fit_sensor_of(request: FitRequest) -> tuple[SensorModel, CalibrationReport]:
    """Fit a sensor curve to the one selected calibration curve; without a usable fit, raise an error."""
    curves = request.read()
    if len(curves) > 1:
        raise InvalidInputError(
            f"select: the file {request.path.name} contains {len(curves)} curves, but exactly one is needed; "
            f"choose a curve by its labels, for example {_as_toml(curves[0].labels)}"
        )
    report = request.rank(curves[0])
    if report.best is None:
        reasons = "; ".join(report.reasons)
        raise InvalidInputError(f"{request.path.name}: {report.verdict}{f' ({reasons})' if reasons else ''}")
    return report.best.sensor, report
