"""Implement the command `pretouch init`, which writes a first scenario file."""

from __future__ import annotations

import hashlib
import math
import os
import sys
import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeVar

import typer

from pretouch._core.errors import InvalidInputError, PretouchError, UnitError
from pretouch._core.files import as_json, refuse_input, write_text
from pretouch._core.units import missing_unit, read_quantity
from pretouch._core.warning_codes import split_code

from .columns import Columns, Labels, Select, read_columns, read_labels, read_selection, selection_of
from .terminal import conclude, option, print_text
from .verbs import refuse_existing

if TYPE_CHECKING:
    from pretouch.config.sensor import FitRequest
    from pretouch.simulation import SensorPart

_T = TypeVar("_T")
_NONE: Final = "other"  # the answer for a sensor that is no built-in part
_INSIDE: Final = 0.98  # of the usable range, at which the encounter starts
_ROUNDING: Final = 1e-6
_DEFAULTS: Final = {"speed": "0.3 m/s", "excursion": "0.2 m", "robot-mass": "4 kg", "rate": "100 Hz"}


def init(
    csv: Annotated[
        Path | None, typer.Argument(metavar="[CSV]", help="Calibration of your sensor, if you have one.")
    ] = None,
    *,
    columns: Columns = None,
    labels: Labels = None,
    select: Select = None,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="PATH", help="The new scenario file.")] = Path(
        "scenario.toml"
    ),
    part: Annotated[str | None, option("NAME", "Sensor part, such as VCNL4010; `other` for none of them.")] = None,
    rate: Annotated[str | None, option("RATE", 'Readings per second of another sensor, such as "100 Hz".')] = None,
    recess: Annotated[
        str | None,
        option("DISTANCE", "Distance of the sensor behind the contact surface; by default, the smallest usable one."),
    ] = None,
    distance: Annotated[
        str | None,
        option("DISTANCE", "Distance at which the sensor sees the object; by default the end of the usable range."),
    ] = None,
    speed: Annotated[str | None, option("SPEED", 'Approach speed, such as "0.3 m/s".')] = None,
    excursion: Annotated[str | None, option("DISTANCE", 'How far the robot can retreat, such as "0.2 m".')] = None,
    contact_speed: Annotated[str | None, option("SPEED", "Largest allowed speed at contact.")] = None,
    robot_mass: Annotated[str | None, option("MASS", 'Reflected mass of the robot, such as "4 kg".')] = None,
    drag: Annotated[bool, typer.Option("--drag", help="Use the virtual drag instead of the virtual damper.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print only a JSON object; ask nothing.")] = False,
) -> None:
    """Write a first scenario file (TOML), ready to run and with a comment on every value.

    In a terminal, asks for everything that no option gives. Otherwise uses the defaults. With a calibration (CSV), the
    file starts at the far end of the usable range.

    Exit status: 0 the file is written, 2 a mistake in the request.
    """
    answers = {"part": part, "rate": rate, "recess": recess, "distance": distance, "speed": speed}
    answers |= {"excursion": excursion, "contact-speed": contact_speed, "robot-mass": robot_mass}

    def run() -> None:
        request = _request(csv, columns, labels, select)
        _init(request, output, answers, drag=drag, force=force, json=json)

    conclude(run, json_wanted=json)


def _request(csv: Path | None, columns: str | None, labels: str | None, select: list[str] | None) -> FitRequest | None:
    """Return the options for fitting a sensor curve to a calibration."""
    from pretouch.config.sensor import FitRequest  # noqa: PLC0415 - keeps `pretouch --help` quick

    if csv is not None:
        return FitRequest(
            path=csv, columns=read_columns(columns), labels=read_labels(labels), select=read_selection(select)
        )
    for name, value in (("columns", columns), ("labels", labels), ("select", select)):
        if value:
            raise InvalidInputError(f"--{name}: this option needs a calibration file; also give the name of a CSV file")
    return None


def _init(
    request: FitRequest | None, output: Path, answers: dict[str, str | None], *, drag: bool, force: bool, json: bool
) -> None:
    """Create, check and write a first scenario file."""
    from pretouch.config import load_document  # noqa: PLC0415 - keeps `pretouch --help` quick
    from pretouch.config.first_scenario import FirstScenario  # noqa: PLC0415

    refuse_existing(output, force=force)
    if request is not None:
        refuse_input(output, request.files)
    if not output.parent.is_dir():
        raise InvalidInputError(f"{output.parent}: there is no such folder; make it, or choose another --output")
    asks = sys.stdin is not None and sys.stdin.isatty() and not json

    def size(name: str, unit: str, asks: bool = asks) -> float:
        return _answer(name, answers, _DEFAULTS.get(name, ""), partial(_size, unit=unit), asks=asks)

    chosen = _answer("part", answers, "VCNL4010" if request is None else _NONE, _part, asks=asks)
    near, far, warnings = _usable(request, chosen)
    if answers["recess"] is not None:
        near = _answer("recess", answers, "", partial(_size, unit="m", zero=True), asks=False)
    reach = math.floor(1e4 * _INSIDE * (far - near)) / 1e4
    start = min(reach, 0.3) if answers["distance"] is None else size("distance", "m", asks=False)
    if not start > 0:
        raise InvalidInputError(
            f"--recess: a recess of {near:g} m is too large, because the usable range of the sensor ends at {far:g} m. "
            "Choose a smaller recess"
        )
    scenario = FirstScenario(
        calibration="" if request is None else Path(os.path.relpath(request.path, output.parent)).as_posix(),
        columns={} if request is None else request.columns,
        labels=None if request is None else request.labels,
        select={} if request is None else request.select,
        recess=near,
        part=chosen,
        rate=size("rate", "Hz") if chosen is None else chosen.chain.rate,
        distance=float(f"{start:.4g}"),
        speed=size("speed", "m/s"),
        excursion=size("excursion", "m"),
        contact_speed=None if answers["contact-speed"] is None else size("contact-speed", "m/s", asks=False),
        robot_mass=size("robot-mass", "kg"),
        drag=drag,
    )
    text = scenario.text()
    load_document(output, text, hashlib.sha256(text.encode()).hexdigest(), tomllib.loads(text))  # it runs
    write_text(output, text, overwrite=force)
    if json:
        print_text(
            as_json(
                {
                    "status": "written",
                    "file": str(output),
                    "calibration": scenario.calibration or None,
                    "warnings": warnings,
                }
            )
        )
        return
    content = "this first scenario file uses a typical sensor curve; replace it by your calibration"
    if request is not None:
        content = "this first scenario file uses your calibration"
    elif chosen is not None and chosen.chain.measures_distance:
        content = (
            f"this first scenario file uses the sensor part {chosen.name}. This part needs no calibration, because it "
            "reports distances"
        )
    print_text(
        f"{output}: {content}.\n\nCheck the values in the file. Then run\n"
        f"  pretouch design {output}    to choose the gain, and\n"
        f"  pretouch verify {output}    to check the gain in a simulated control loop."
    )
    if request is not None and warnings:
        from .summary import warning_lines  # noqa: PLC0415 - keeps `pretouch --help` quick

        lines = [
            f"\nThe calibration in {request.path} is usable, but with these reservations:",
            *(x for w in warnings for x in warning_lines(w)),
        ]
        print_text("\n".join(lines))


def _answer(name: str, answers: dict[str, str | None], default: str, read: Callable[[str], _T], *, asks: bool) -> _T:
    """Parse the value of an option or the user's answer."""
    # An invalid answer is asked again. Without an answer, the default value is parsed.
    value = answers[name]

    def read_answer(text: Any) -> _T:
        try:
            return read(str(text))
        except PretouchError as error:
            raise typer.BadParameter(str(error)) from None

    if value is None and asks:
        answer: _T = typer.prompt(_QUESTIONS[name], default=default, err=True, value_proc=read_answer)
        return answer
    try:
        return read(default if value is None else value)
    except PretouchError as error:
        raise InvalidInputError(f"--{name}: {error}") from None


_QUESTIONS: Final = {
    "part": "Sensor part (RPR-220, VCNL4010, VCNL4040, APDS-9960, VL53L0X, VL53L1X, VL53L5CX-4x4, VL53L5CX-8x8, other)",
    "rate": "Readings per second",
    "speed": "How fast does the object approach",
    "excursion": "How far can the robot retreat",
    "robot-mass": "Reflected mass of the robot at the contact point",
}

_DIMENSIONS: Final = {
    "m": ("length", "200 mm"),
    "m/s": ("speed", "0.3 m/s"),
    "kg": ("mass", "4 kg"),
    "Hz": ("rate", "100 Hz"),
}
"""The name and an example of the quantities that have a unit."""


def _size(text: str, *, unit: str, zero: bool = False) -> float:
    """Parse a positive quantity with its unit."""
    # If `zero` is true, 0 is also allowed.
    name, example = _DIMENSIONS[unit]
    if zero and text.strip() == "0":
        return 0.0
    try:
        value = math.nan if missing_unit(text, unit) else read_quantity(text, unit, name="")
    except UnitError:
        value = math.nan
    if math.isnan(value):
        raise InvalidInputError(f"found {text}, expected a {name} with its unit, such as {example}")
    if not (0 < value < math.inf or (zero and value == 0)):
        raise InvalidInputError(f"found {text}, expected a positive {name}, such as {example}")
    return value


def _part(name: str) -> SensorPart | None:
    """Return the sensor part with a given name."""
    # The result is None for the name `other`.
    from pretouch.simulation import PARTS  # noqa: PLC0415

    if name.lower() == _NONE:
        return None
    parts = {parts.lower(): part for parts, part in PARTS.items()}
    if name.lower() not in parts:
        raise InvalidInputError(f"found {name!r}, expected one of {', '.join(PARTS)}, or {_NONE}")
    return parts[name.lower()]


def _usable(request: FitRequest | None, part: SensorPart | None) -> tuple[float, float, tuple[str, ...]]:
    """Return the usable distance range and the calibration warnings."""
    # The distances are in m, the smallest one rounded up to 0.1 mm.
    if request is None:
        return 0.0, 0.1 if part is None else part.range[1], ()
    curves = request.read()
    if len(curves) > 1:
        raise InvalidInputError(
            f"{request.path}: found {len(curves)} calibration curves, expected one; choose a curve with "
            f"--select, for example {selection_of(curves[0].label)}"
        )
    report = request.rank(curves[0])
    if report.best is None:
        reasons = " ".join(split_code(reason)[1] for reason in report.reasons)
        raise InvalidInputError(f"{request.path}: {report.verdict}, so no sensor curve can be fitted. {reasons}")
    warnings = () if report.verdict == "usable" else report.reasons
    return math.ceil(1e4 * report.window.l_min - _ROUNDING) / 1e4, report.window.l_max, warnings
