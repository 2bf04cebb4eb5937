"""Implement the command `pretouch init`, which writes a first scenario file."""

from __future__ import annotations

import hashlib
import math
import os
import sys
import tomllib
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from pretouch._core.errors import InvalidInputError
from pretouch._core.files import as_json, refuse_input, write_text
from pretouch._core.units import read_quantity
from pretouch._core.warning_codes import split_code

from .terminal import conclude, option, print_text
from .verbs import refuse_existing

if TYPE_CHECKING:
    from pretouch.simulation import SensorPart

_NONE: Final = "other"  # the answer for a sensor that is no built-in part
_INSIDE: Final = 0.98  # of the usable range, at which the encounter starts
_ROUNDING: Final = 1e-6
_DEFAULTS: Final = {"speed": "0.3 m/s", "excursion": "0.2 m", "robot-mass": "4 kg", "rate": "100 Hz"}


def init(
    csv: Annotated[
        Path | None, typer.Argument(metavar="[CSV]", help="Calibration of your sensor, if you have one.")
    ] = None,
    *,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="PATH", help="The new scenario file.")] = Path(
        "scenario.toml"
    ),
    part: Annotated[str | None, option("NAME", "Sensor part, such as VCNL4010; `other` for none of them.")] = None,
    rate: Annotated[str | None, option("RATE", 'Readings per second of another sensor, such as "100 Hz".')] = None,
    recess: Annotated[
        str | None,
        option("DISTANCE", "Distance of the sensor behind the contact surface; by default as far as the fit needs."),
    ] = None,
    distance: Annotated[
        str | None, option("DISTANCE", "Distance at which the sensor sees the object; by default the usable range.")
    ] = None,
    speed: Annotated[str | None, option("SPEED", 'Approach speed, such as "0.3 m/s".')] = None,
    excursion: Annotated[str | None, option("DISTANCE", 'How far the robot can retreat, such as "0.2 m".')] = None,
    contact_speed: Annotated[str | None, option("SPEED", "Largest allowed speed at contact.")] = None,
    robot_mass: Annotated[str | None, option("MASS", 'Reflected mass of the robot, such as "4 kg".')] = None,
    drag: Annotated[bool, typer.Option("--drag", help="Use the virtual drag instead of the virtual damper.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print only a JSON object; ask nothing.")] = False,
) -> None:
    """Write a first scenario file (TOML) that runs, with a comment on every value.

    In a terminal, asks for everything that no option gives. Otherwise uses the defaults. With a calibration (CSV), the
    file starts at the far end of the usable range.

    Exit status: 0 the file is written, 2 a mistake in the request.
    """
    given = {"part": part, "rate": rate, "recess": recess, "distance": distance, "speed": speed}
    given |= {"excursion": excursion, "contact-speed": contact_speed, "robot-mass": robot_mass}
    conclude(partial(_init, csv, output, given, drag=drag, force=force, json=json), json_wanted=json)


def _init(csv: Path | None, output: Path, given: dict[str, str | None], *, drag: bool, force: bool, json: bool) -> None:
    """Collect the answers, check the file that they result in, and write it."""
    from pretouch.config import load_document  # noqa: PLC0415 - keeps `pretouch --help` quick
    from pretouch.config.first_scenario import FirstScenario  # noqa: PLC0415

    refuse_existing(output, force=force)
    if csv is not None:
        refuse_input(output, [csv])
    if not output.parent.is_dir():
        raise InvalidInputError(f"{output.parent}: there is no such folder; make it, or choose another --output")
    asks = sys.stdin is not None and sys.stdin.isatty() and not json
    chosen = _part(_answer("part", given, "VCNL4010" if csv is None else _NONE, asks))
    near, far, warnings = _usable(csv, chosen)
    if given["recess"] is not None:
        near = read_quantity(given["recess"], "m", name="--recess")
    reach = math.floor(1e4 * _INSIDE * (far - near)) / 1e4
    start = min(reach, 0.3) if given["distance"] is None else _size("distance", given, "", "m", asks=False)
    if not start > 0:
        raise InvalidInputError(
            f"--recess: a recess of {near:g} m leaves nothing of the usable range, which ends at {far:g} m"
        )
    scenario = FirstScenario(
        calibration="" if csv is None else Path(os.path.relpath(csv, output.parent)).as_posix(),
        recess=near,
        part=chosen,
        rate=_size("rate", given, _DEFAULTS["rate"], "Hz", asks=asks) if chosen is None else chosen.chain.rate,
        distance=float(f"{start:.4g}"),
        speed=_size("speed", given, _DEFAULTS["speed"], "m/s", asks=asks),
        excursion=_size("excursion", given, _DEFAULTS["excursion"], "m", asks=asks),
        contact_speed=None if given["contact-speed"] is None else _size("contact-speed", given, "", "m/s", asks=False),
        robot_mass=_size("robot-mass", given, _DEFAULTS["robot-mass"], "kg", asks=asks),
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
    source = "your calibration" if csv is not None else "a typical sensor curve; replace it by your calibration"
    if csv is None and chosen is not None and chosen.chain.measures_distance:
        source = f"the {chosen.name}, which needs no calibration, because it reports distances"
    print_text(
        f"{output}: a first scenario with {source}.\n\nCheck the values in the file. Then run\n"
        f"  pretouch design {output}    to choose the gain, and\n"
        f"  pretouch verify {output}    to check it on the sampled loop."
    )
    if warnings:
        from .summary import warning_lines  # noqa: PLC0415 - keeps `pretouch --help` quick

        lines = [
            f"\nThe readings in {csv} are usable with reservations.",
            *(x for w in warnings for x in warning_lines(w)),
        ]
        print_text("\n".join(lines))


def _answer(name: str, given: dict[str, str | None], default: str, asks: bool) -> str:
    """Return the value of an option, the answer to a question, or the default."""
    value = given[name]
    if value is not None or not asks:
        return default if value is None else value
    answer: Any = typer.prompt(_QUESTIONS[name], default=default, err=True)
    return str(answer)


_QUESTIONS: Final = {
    "part": "Sensor part (RPR-220, VCNL4010, VCNL4040, APDS-9960, VL53L0X, VL53L1X, VL53L5CX-4x4, VL53L5CX-8x8, other)",
    "rate": "Readings per second",
    "speed": "How fast does the object approach",
    "excursion": "How far can the robot retreat",
    "robot-mass": "Reflected mass of the robot at the contact point",
}


def _size(name: str, given: dict[str, str | None], default: str, unit: str, *, asks: bool) -> float:
    """Return a positive quantity from an option, an answer or the default."""
    value = read_quantity(_answer(name, given, default, asks), unit, name=f"--{name}")
    if not 0 < value < float("inf"):
        raise InvalidInputError(f"--{name}: found {value:g} {unit}, expected a positive number")
    return float(value)


def _part(name: str) -> SensorPart | None:
    """Return the sensor part of a name in any case; None for another sensor."""
    from pretouch.simulation import PARTS  # noqa: PLC0415

    if name.lower() == _NONE:
        return None
    known = {known.lower(): part for known, part in PARTS.items()}
    if name.lower() not in known:
        raise InvalidInputError(f"--part: found {name!r}, expected one of {', '.join(PARTS)}, or {_NONE}")
    return known[name.lower()]


def _usable(csv: Path | None, part: SensorPart | None) -> tuple[float, float, tuple[str, ...]]:
    """Return the smallest (in tenths of mm) and the largest usable distance [m], and warnings about the calibration."""
    if csv is None:
        return 0.0, 0.1 if part is None else part.range[1], ()
    from pretouch.config.sensor import FitRequest  # noqa: PLC0415

    request = FitRequest(path=csv)
    curves = request.read()
    if len(curves) > 1:
        raise InvalidInputError(
            f"{csv}: found {len(curves)} curves, expected one; select a curve with the key `select` of [sensor]"
        )
    report = request.rank(curves[0])
    if report.best is None:
        reasons = " ".join(split_code(reason)[1] for reason in report.reasons)
        raise InvalidInputError(f"{csv}: {report.verdict}, so no sensor curve can be fitted. {reasons}")
    warnings = () if report.verdict == "usable" else report.reasons
    return math.ceil(1e4 * report.window.l_min - _ROUNDING) / 1e4, report.window.l_max, warnings
