"""Implement the command `pretouch record`, which records a sensor calibration at the bench."""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from pretouch._core.errors import InvalidInputError
from pretouch._core.files import as_json
from pretouch._core.units import read_quantity

from .terminal import conclude, end, option, print_text

if TYPE_CHECKING:
    from pretouch.recording.record_distances import DistancePlan
    from pretouch.recording.record_judgment import RecordGoal
    from pretouch.recording.record_session import RecordOptions
    from pretouch.recording.sources.source import ReadingSource

_INTERRUPTED: Final = 130  # exit status of a command that was ended with Ctrl-C


@dataclass(frozen=True, slots=True, kw_only=True)
class _Origin:
    """The command-line options that choose the source of the sensor readings."""

    port: str | None
    baud: int
    topic: str | None
    domain: int
    unit: str | None
    i2c: str | None
    bus: int
    rate: str | None
    stdin: bool
    column: str
    distance_column: str
    distance_unit: str
    decimal: str

    def open(self) -> ReadingSource:
        """Open the source of the sensor readings. The default is the only serial port of the computer."""
        from pretouch.recording.sources.lines import LineFormat  # noqa: PLC0415 - keeps `pretouch --help` quick

        chosen = [
            name
            for name, value in (
                ("--port", self.port),
                ("--topic", self.topic),
                ("--i2c", self.i2c),
                ("--stdin", self.stdin),
            )
            if value
        ]
        if len(chosen) > 1:
            raise InvalidInputError(
                f"{' and '.join(chosen)}: found {len(chosen)} sources of readings, expected only one of these options"
            )
        layout = LineFormat(
            column=self.column,
            distance_column=self.distance_column,
            distance_unit=self.distance_unit,
            decimal_mark=self.decimal,
        )
        if self.topic:
            from pretouch.recording.sources.topic import TopicSource  # noqa: PLC0415

            return TopicSource(self.topic, self.domain, self.unit)
        if self.i2c:
            from pretouch.recording.sources.i2c import I2cSource  # noqa: PLC0415

            rate = None if self.rate is None else read_quantity(self.rate, "Hz", name="--rate")
            return I2cSource(self.i2c, self.bus, rate)
        if self.stdin:
            from pretouch.recording.sources.standard_input import StandardInput  # noqa: PLC0415

            return StandardInput(layout)
        from pretouch.recording.sources.serial_port import SerialSource  # noqa: PLC0415

        return SerialSource(self.port, self.baud, layout)


def record(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="The calibration to write (CSV), or a scenario file (TOML) that names the calibration to write.",
        ),
    ],
    *,
    port: Annotated[str | None, option("PORT", "Serial port of the sensor; by default the only one.")] = None,
    baud: Annotated[int, option("NUMBER", "Baud rate of the serial port.", min=1)] = 115200,
    topic: Annotated[
        str | None, option("TOPIC", "ROS 2 topic (Range, or a number of std_msgs), read through DDS without ROS.")
    ] = None,
    domain: Annotated[int, option("NUMBER", "DDS domain of the topic.", envvar="ROS_DOMAIN_ID", min=0, max=232)] = 0,
    i2c: Annotated[str | None, option("PART", "Sensor at an I2C bus under Linux: VCNL4040 or VCNL4010.")] = None,
    bus: Annotated[int, option("NUMBER", "Number of the I2C bus.", min=0)] = 1,
    rate: Annotated[
        str | None, option("RATE", "Readings per second from the I2C bus; by default those of the part.")
    ] = None,
    stdin: Annotated[bool, typer.Option("--stdin", help="Read lines from standard input.")] = False,
    column: Annotated[
        str, option("COLUMN", "The output in each line: a column number from 1, a name in a header, or a JSON key.")
    ] = "",
    distance_column: Annotated[
        str, option("COLUMN", "The distance in each line, if the source sends it; inf means no object.")
    ] = "",
    distance_unit: Annotated[
        str, option("UNIT", "Unit of --distance-column; by default the one that the lines state, or mm.")
    ] = "",
    decimal: Annotated[
        str, option("MARK", 'Decimal sign of the lines, "." or ",", if they can be read in two ways.')
    ] = "",
    unit: Annotated[str | None, option("UNIT", "Unit of the output, such as V or counts.")] = None,
    distances: Annotated[
        str | None, option("LIST", 'Distances, such as "0 mm, 5 mm, 10 mm"; by default you type each distance.')
    ] = None,
    stage: Annotated[
        str | None, option("COMMAND", "Command that moves a linear stage to each distance: 'move-stage {mm}'.")
    ] = None,
    readings: Annotated[int, option("NUMBER", "Readings at each distance, and of the empty scene.", min=3)] = 20,
    dwell: Annotated[str, option("TIME", "Time over which these readings are spread.")] = "1 s",
    timeout: Annotated[str, option("TIME", "Time without a reading after which the source counts as silent.")] = "5 s",
    accuracy: Annotated[str, option("PERCENT", "Largest uncertainty of the slope g.")] = "5 %",
    empty_scene: Annotated[
        bool, typer.Option("--empty-scene/--no-empty-scene", help="Record readings without an object first.")
    ] = True,
    all_distances: Annotated[
        bool, typer.Option("--all", help="Record all distances, even if the slope g is known before.")
    ] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted recording.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print all warnings and files.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print a JSON object at the end.")] = False,
) -> None:
    """Record a sensor calibration at the bench, step by step, and write it as CSV.

    Records the empty scene first, then distance after distance. At each distance, waits until the output has settled.
    Names the distances that are still missing. Ends when the slope g is known well enough, for the scenario if FILE is
    one. All readings are also written to STEM-raw.csv. Nothing is overwritten.

    Exit status: 0 the slope is known well enough, 1 more readings are needed, 2 a mistake in the request, or the
    source failed, 130 interrupted with Ctrl-C; the readings are kept.
    """
    origin = _Origin(
        port=port,
        baud=baud,
        topic=topic,
        domain=domain,
        unit=unit,
        i2c=i2c,
        bus=bus,
        rate=rate,
        stdin=stdin,
        column=column,
        distance_column=distance_column,
        distance_unit=distance_unit,
        decimal=decimal,
    )

    def run() -> None:
        from pretouch.recording.record_session import RecordOptions  # noqa: PLC0415 - keeps `pretouch --help` quick

        path, goal = _goal(file, read_quantity(accuracy, "", name="--accuracy"))
        options = RecordOptions(
            readings=readings,
            dwell=read_quantity(dwell, "s", name="--dwell"),
            timeout=read_quantity(timeout, "s", name="--timeout"),
            empty=empty_scene and not (stdin and distance_column),
            all_distances=all_distances,
        )
        _record(
            path,
            goal,
            options,
            origin,
            _Steps(distances, stage, bool(distance_column), resume, unit),
            verbose=verbose,
            json=json,
        )

    conclude(run, json_wanted=json)


@dataclass(frozen=True, slots=True)
class _Steps:
    """The command-line options on distances, unit and continuation of a recording."""

    distances: str | None
    stage: str | None
    sent: bool
    resume: bool
    unit: str | None

    @property
    def wanted(self) -> tuple[float, ...]:
        """The distances [m] in the option --distances; empty without this option."""
        from pretouch.recording.record_distances import read_distances  # noqa: PLC0415

        if self.sent and (self.distances is not None or self.stage is not None):
            raise InvalidInputError(
                "--distance-column: the source sends the distances, so --distances and --stage are not allowed"
            )
        if self.distances is None and self.stage is not None:
            raise InvalidInputError('--stage: needs the distances to move to, such as --distances "5 mm, 10 mm, 20 mm"')
        return () if self.distances is None else read_distances(self.distances)

    def plan(self, wanted: tuple[float, ...], done: tuple[float, ...]) -> DistancePlan:
        """Return the distances that must still be recorded.

        The distances are those of a list, or those that the user types.
        """
        from pretouch.recording.record_distances import ListedDistances, TypedDistances  # noqa: PLC0415

        return ListedDistances(wanted, done, self.stage) if self.distances is not None else TypedDistances()


def _goal(file: Path, accuracy: float) -> tuple[Path, RecordGoal]:
    """Return the calibration path and the required accuracy and distances."""
    from pretouch.recording.record_judgment import RecordGoal  # noqa: PLC0415

    if not 0 < accuracy < 1:
        raise InvalidInputError(f"--accuracy: found {100 * accuracy:g} %, expected more than 0 % and less than 100 %")
    if file.suffix.lower() != ".toml":
        return file, RecordGoal(accuracy=accuracy)
    from pretouch.config import load_calibration_plan, load_scenario  # noqa: PLC0415

    plan = load_calibration_plan(file)
    load = partial(load_scenario, file)
    return plan.path, RecordGoal(accuracy=accuracy, nearest=plan.nearest, farthest=plan.farthest, load=load)


def _record(
    path: Path, goal: RecordGoal, options: RecordOptions, origin: _Origin, steps: _Steps, *, verbose: bool, json: bool
) -> None:
    """Record a calibration, print the result, and exit with its status."""
    from pretouch.recording.record_file import RecordFile, check_free  # noqa: PLC0415
    from pretouch.recording.record_session import record_calibration  # noqa: PLC0415
    from pretouch.report.pages import page_of  # noqa: PLC0415

    from .record_display import LiveDisplay, PlainDisplay  # noqa: PLC0415
    from .summary import summary_of  # noqa: PLC0415

    if not steps.resume:
        check_free(path)
    is_terminal = sys.stderr is not None and sys.stderr.isatty()
    display = (LiveDisplay if is_terminal else PlainDisplay)(readings_on_stdin=origin.stdin)
    wanted = steps.wanted
    steps.plan(wanted, ())  # mistakes in the options are reported before a device is opened
    if wanted and goal.load is None:
        goal = replace(goal, nearest=min(wanted), limit=max(wanted))
    source = origin.open()
    try:
        file = RecordFile(path, unit=steps.unit or source.unit, origin=source.name, resume=steps.resume)
    except BaseException:
        source.close()
        raise
    plan = None if origin.distance_column else steps.plan(wanted, file.complete(options.readings))
    with closing(display):
        result = record_calibration(source, file, plan, display, options=options, goal=goal)
    if json:
        print_text(as_json(result.to_dict()))
    else:
        print_text(str(result) if verbose else summary_of(page_of(result), lines=15))
    if result.interrupted:
        raise typer.Exit(_INTERRUPTED)
    end(good=result.judgment.is_enough)
