"""Implement the command `pretouch init`, which writes a first scenario file."""

from __future__ import annotations

import math
import os
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeVar

import typer

from pretouch._core.errors import InvalidInputError, PretouchError, ScenarioFileError, UnitError
from pretouch._core.files import as_json, refuse_input, write_text
from pretouch._core.units import format_quantity, missing_unit, read_quantity
from pretouch._core.warning_codes import split_code

from .columns import (
    Columns,
    Labels,
    Select,
    fullest,
    read_columns,
    read_labels,
    read_selection,
    selection_of,
    without_labels,
)
from .terminal import conclude, option, print_text
from .verbs import refuse_existing

if TYPE_CHECKING:
    from pretouch.config.first_scenario import FirstScenario
    from pretouch.config.sensor import FitRequest
    from pretouch.designs import Task
    from pretouch.simulation import SensorPart

_T = TypeVar("_T")
_NONE: Final = "other"  # the answer for a sensor that is no built-in part
_INSIDE: Final = 0.98  # of the usable range, at which the encounter starts
_ROUNDING: Final = 1e-6
_UNKNOWN_RANGE: Final = 1.0  # m, of a sensor without data sheet and calibration
_TYPICAL: Final = 0.098  # m, farthest start with such a sensor
_MOST: Final = 0.3  # m, farthest start whose distance is not given


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
    rate: Annotated[str | None, option("RATE", 'Readings per second, such as "100 Hz".')] = None,
    control_rate: Annotated[
        str | None, option("RATE", "Control steps per second; by default 1 kHz, or the rate of a faster sensor.")
    ] = None,
    latency: Annotated[
        str | None, option("TIME", 'Time from the end of a measurement until the controller has it, such as "5 ms".')
    ] = None,
    recess: Annotated[
        str | None,
        option(
            "DISTANCE",
            "Distance of the sensor behind the contact surface. Required if the usable range does not start at 0.",
        ),
    ] = None,
    distance: Annotated[
        str | None,
        option("DISTANCE", "Distance at which the sensor sees the object; by default the end of the usable range."),
    ] = None,
    speed: Annotated[str | None, option("SPEED", 'Approach speed, such as "0.3 m/s".')] = None,
    speed_spread: Annotated[
        str | None,
        option("SPEED", 'Standard deviation of the approach speed, such as "0.02 m/s"; by default 20 % of the speed.'),
    ] = None,
    acceleration: Annotated[
        str | None, option("ACCELERATION", 'Acceleration of the object; "-9.81 m/s^2" for a leg that lands.')
    ] = None,
    excursion: Annotated[str | None, option("DISTANCE", 'How far the robot can retreat, such as "0.2 m".')] = None,
    contact_speed: Annotated[str | None, option("SPEED", "Largest allowed speed at contact.")] = None,
    impact_force: Annotated[str | None, option("FORCE", 'Largest allowed impact force, such as "50 N".')] = None,
    robot_mass: Annotated[str | None, option("MASS", 'Reflected mass of the robot, such as "4 kg".')] = None,
    stiffness: Annotated[str | None, option("STIFFNESS", 'Stiffness of the contact, such as "30 kN/m".')] = None,
    effective_modulus: Annotated[
        str | None, option("MODULUS", 'Effective modulus of the padding, such as "10 MPa", instead of a stiffness.')
    ] = None,
    radius: Annotated[str | None, option("LENGTH", 'Radius of the contact surface, such as "10 mm".')] = None,
    drag: Annotated[bool, typer.Option("--drag", help="Use the virtual drag instead of the virtual damper.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print only a JSON object; ask nothing.")] = False,
) -> None:
    """Write a first scenario file (TOML), ready to run and with a comment on every value.

    In a terminal, asks for the most important values that no option gives. Otherwise uses the defaults. With a
    calibration (CSV), the encounter starts at the far end of the usable range. The floor of the controller detects the
    object there.

    Exit status: 0 the file is written, 2 a mistake in the request.
    """
    answers = {"part": part, "rate": rate, "recess": recess, "distance": distance, "speed": speed}
    answers |= {"control-rate": control_rate, "latency": latency, "acceleration": acceleration}
    answers |= {"excursion": excursion, "contact-speed": contact_speed, "impact-force": impact_force}
    answers |= {"robot-mass": robot_mass, "stiffness": stiffness, "effective-modulus": effective_modulus}
    answers |= {"radius": radius, "speed-spread": speed_spread}

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
    import hashlib  # noqa: PLC0415 - keeps `pretouch --help` quick
    import tomllib  # noqa: PLC0415

    from pretouch.config import load_document  # noqa: PLC0415

    refuse_existing(output, force=force)
    if request is not None:
        refuse_input(output, request.files)
    if not output.parent.is_dir():
        raise InvalidInputError(f"{output.parent}: there is no such folder; make it, or choose another --output")
    asks = sys.stdin is not None and sys.stdin.isatty() and not json

    draft, warnings = _draft(request, output, answers, drag=drag, asks=asks)

    def load(text: str) -> Task:
        try:
            return load_document(output, text, hashlib.sha256(text.encode()).hexdigest(), tomllib.loads(text))
        except ScenarioFileError as error:  # no such file exists: the message must name options
            raise InvalidInputError(_as_options(str(error))) from None

    scenario = draft.starting_where_detected(load, keep_distance=answers["distance"] is not None)
    text = scenario.text()
    load(text)  # it runs
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
        if scenario.recess > 0:
            recess = format_quantity(scenario.recess, "m")
            content += f".\nMount the sensor {recess} behind the contact surface, as recess says in this file"
    elif scenario.part is not None and scenario.part.chain.measures_distance:
        content = (
            f"this first scenario file uses the sensor part {scenario.part.name}. This part needs no calibration, "
            "because it reports distances"
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


def _draft(
    request: FitRequest | None, output: Path, answers: dict[str, str | None], *, drag: bool, asks: bool
) -> tuple[FirstScenario, tuple[str, ...]]:
    """Return a first scenario from options and answers, and the calibration warnings."""
    from pretouch.config.first_scenario import FirstScenario  # noqa: PLC0415 - keeps `pretouch --help` quick

    if answers["stiffness"] is not None and (answers["effective-modulus"] or answers["radius"]):
        raise InvalidInputError(
            "--stiffness: found a stiffness together with a padding; remove --stiffness, or --effective-modulus and "
            "--radius"
        )

    def size(name: str) -> float:
        return _answer(name, answers, _SIZES[name].default, partial(_size, name), asks=asks and bool(_question(name)))

    def given(name: str) -> float | None:
        return None if answers[name] is None else size(name)

    chosen = _answer("part", answers, "VCNL4010" if request is None else _NONE, _part, asks=asks)
    near, far, warnings = _usable(request, chosen)
    recess = _recess(answers, near, asks=asks)
    start = _start(recess, far, given("distance"), _TYPICAL if request is None and chosen is None else _MOST)
    draft = FirstScenario(
        calibration="" if request is None else Path(os.path.relpath(request.path, output.parent)).as_posix(),
        columns={} if request is None else request.columns,
        labels=None if request is None else request.labels,
        select={} if request is None else request.select,
        recess=recess,
        part=chosen,
        rate=size("rate") if chosen is None or answers["rate"] is not None else chosen.chain.rate,
        control_rate=given("control-rate"),
        latency=given("latency"),
        distance=float(f"{start:.4g}"),
        floor=None,
        speed=size("speed"),
        speed_spread=given("speed-spread"),
        acceleration=size("acceleration"),
        excursion=size("excursion"),
        contact_speed=given("contact-speed"),
        impact_force=given("impact-force"),
        robot_mass=size("robot-mass"),
        stiffness=given("stiffness"),
        effective_modulus=size("effective-modulus"),
        radius=size("radius"),
        drag=drag,
    )
    return draft, warnings


def _recess(answers: dict[str, str | None], near: float, *, asks: bool) -> float:
    """Return how far the sensor is behind the contact surface [m]. Only the user knows it.

    `near` is the smallest usable distance from the sensor [m], which contact must not be below.

    Raises:
        InvalidInputError: the recess is not given, although contact is not in the usable range without it.
    """
    nearest = format_quantity(near, "m")
    if answers["recess"] is None and near > 0 and not asks:
        raise InvalidInputError(
            f"--recess: the usable range of the sensor starts at {nearest}, but the sensor must see the object until "
            "contact. Give the distance of the sensor behind the contact surface, such as --recess "
            f'"{nearest}", or more. Otherwise, record readings at smaller distances'
        )
    question = f"How far is the sensor behind the contact surface (its usable range starts at {nearest})"
    return _answer(
        "recess",
        answers,
        nearest if near > 0 else "0",
        partial(_size, "recess"),
        asks=asks and near > 0,
        question=question,
    )


def _start(near: float, far: float, distance: float | None, most: float) -> float:
    """Return the distance at the start [m]. By default, it is near the end of the usable range, but at most `most`."""
    reach = math.floor(1e4 * _INSIDE * (far - near)) / 1e4
    if not reach > 0:
        raise InvalidInputError(
            f"--recess: a recess of {near:g} m is too large, because the usable range of the sensor ends at {far:g} m. "
            "Choose a smaller recess"
        )
    if distance is not None and distance > far - near:
        raise InvalidInputError(
            f"--distance: found {distance:g} m, but the usable range of the sensor ends at a distance of "
            f"{far - near:g} m. Choose a smaller distance"
        )
    return min(reach, most) if distance is None else distance


def _answer(
    name: str,
    answers: dict[str, str | None],
    default: str,
    read: Callable[[str], _T],
    *,
    asks: bool,
    question: str | None = None,
) -> _T:
    """Parse an option, the user's answer or the default; an invalid answer is asked again."""
    value = answers[name]

    def read_answer(text: Any) -> _T:
        try:
            return read(str(text))
        except PretouchError as error:
            raise typer.BadParameter(str(error)) from None

    if value is None and asks:
        answer: _T = typer.prompt(question or _question(name), default=default, err=True, value_proc=read_answer)
        return answer
    try:
        return read(default if value is None else value)
    except PretouchError as error:
        raise InvalidInputError(f"--{name}: {error}") from None


@dataclass(frozen=True, slots=True)
class _Size:
    """A quantity of the first scenario."""

    kind: str  # kind of the answer, in words
    unit: str
    example: str
    default: str  # its value if it is not given; empty for none
    question: str = ""  # what a terminal is asked; empty if it is not asked
    sign: str = "positive"  # `positive`, `nonnegative` or `any`


_PARTS_QUESTION: Final = (
    "Sensor part (RPR-220, VCNL4010, VCNL4040, APDS-9960, VL53L0X, VL53L1X, VL53L5CX-4x4, VL53L5CX-8x8, other)"
)
_SIZES: Final = {
    "rate": _Size("rate", "Hz", "100 Hz", "100 Hz", "Readings per second"),
    "control-rate": _Size("rate", "Hz", "1 kHz", ""),
    "latency": _Size("time", "s", "5 ms", "", sign="nonnegative"),
    "recess": _Size("length", "m", "200 mm", "", sign="nonnegative"),
    "distance": _Size("length", "m", "200 mm", ""),
    "speed": _Size("speed", "m/s", "0.3 m/s", "0.3 m/s", "How fast does the object approach"),
    "speed-spread": _Size("speed", "m/s", "0.02 m/s", ""),
    "acceleration": _Size("acceleration", "m/s^2", "-9.81 m/s^2", "0 m/s^2", sign="any"),
    "excursion": _Size("length", "m", "200 mm", "0.2 m", "How far can the robot retreat"),
    "contact-speed": _Size("speed", "m/s", "0.3 m/s", ""),
    "impact-force": _Size("force", "N", "50 N", ""),
    "robot-mass": _Size("mass", "kg", "4 kg", "4 kg", "Reflected mass of the robot at the contact point"),
    "stiffness": _Size("stiffness", "N/m", "30 kN/m", ""),
    "effective-modulus": _Size("modulus", "Pa", "10 MPa", "10 MPa"),
    "radius": _Size("length", "m", "10 mm", "10 mm"),
}
"""The quantities by the names of their options."""


def _question(name: str) -> str:
    """Return what a terminal is asked for an option; empty if it is not asked."""
    return _PARTS_QUESTION if name == "part" else _SIZES[name].question


def _size(name: str, text: str) -> float:
    """Parse a quantity with its unit."""
    size = _SIZES[name]
    if size.sign == "nonnegative" and text.strip() == "0":
        return 0.0
    try:
        value = math.nan if missing_unit(text, size.unit) else read_quantity(text, size.unit, name="")
    except UnitError:
        value = math.nan
    article = "an" if size.kind[0] in "aeiou" else "a"
    if math.isnan(value):
        raise InvalidInputError(f"found {text}, expected {article} {size.kind} with its unit, such as {size.example}")
    allowed = size.sign == "any" or value > 0 or (size.sign == "nonnegative" and value == 0)
    if not (allowed and math.isfinite(value)):
        sign = "finite" if size.sign == "any" else "positive"
        raise InvalidInputError(f"found {text}, expected a {sign} {size.kind}, such as {size.example}")
    return value


_OPTION_OF: Final = {
    "chain.part": "--part",
    "chain.rate": "--rate",
    "chain.exposure": "--rate",
    "chain.delay": "--latency",
    "chain": "--rate, --latency",
    "controller.rate": "--control-rate",
    "controller": "--control-rate, --latency",
    "obstacle.position": "--distance",
    "obstacle.velocity": "--speed",
    "uncertainty.obstacle.velocity": "--speed, --speed-spread",
    "obstacle.acceleration": "--acceleration",
    "constraints.excursion": "--excursion",
    "constraints.relative_velocity": "--contact-speed",
    "constraints.impact_force": "--impact-force",
    "impact.robot_mass": "--robot-mass",
    "robot.mass": "--robot-mass",
    "impact.stiffness": "--stiffness",
    "impact.effective_modulus": "--effective-modulus",
    "impact.radius": "--radius",
    "impact": "--stiffness, --effective-modulus, --radius",
    "robot": "--robot-mass",
    "sensor.recess": "--recess",
    "sensor.calibration": "CSV",
    "sensor": "--recess",
    "loop.horizon": "--distance, --speed",
    "law": "--drag",
}
"""The option that sets a key or section of the scenario file."""


def _as_options(message: str) -> str:
    """Return the mistakes of a scenario that was not written, with options instead of keys and lines."""
    rows = []
    for row in message.splitlines():
        located = re.fullmatch(r".*?, line \d+: ([\w.\[\]]+): (.*)", row)
        key, sentence = (located[1], located[2]) if located else ("", row)
        named = _OPTION_OF.get(key) or _OPTION_OF.get(key.partition(".")[0])
        sentence = re.sub(r" \(see the key [^)]*\)|, line \d+", "", sentence)
        rows.append(f"{named}: {sentence}" if named else f"these options describe no valid scenario: {sentence}")
    return "\n".join(rows)


def _part(name: str) -> SensorPart | None:
    """Return the sensor part with a given name. The result is None for the name `other`."""
    from pretouch.simulation import PARTS  # noqa: PLC0415

    if name.lower() == _NONE:
        return None
    parts = {parts.lower(): part for parts, part in PARTS.items()}
    if name.lower() not in parts:
        raise InvalidInputError(
            f"found {name!r}, expected one of {', '.join(PARTS)}, or {_NONE}", value=name, limit=(*PARTS, _NONE)
        )
    return parts[name.lower()]


def _usable(request: FitRequest | None, part: SensorPart | None) -> tuple[float, float, tuple[str, ...]]:
    """Return the usable distances [m], the smallest one rounded up to 0.1 mm, and the calibration warnings."""
    if request is None:
        return 0.0, _UNKNOWN_RANGE if part is None else part.range[1], ()
    curves = request.read()
    if len(curves) > 1:
        raise InvalidInputError(
            f"{request.path}: found {len(curves)} calibration curves, expected one; choose a curve with "
            f"--select, for example {selection_of(fullest(curves))}{without_labels(request)}"
        )
    report = request.rank(curves[0])
    if report.best is None:
        reasons = " ".join(split_code(reason)[1] for reason in report.reasons)
        raise InvalidInputError(f"{request.path}: {report.verdict}, so no sensor curve can be fitted. {reasons}")
    warnings = () if report.verdict == "usable" else report.reasons
    return math.ceil(1e4 * report.window.l_min - _ROUNDING) / 1e4, report.window.l_max, warnings
