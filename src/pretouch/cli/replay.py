"""Implement the command `pretouch replay` for recorded sensor readings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pretouch._core.errors import InvalidInputError
from pretouch._core.files import refuse_input, write_text
from pretouch._core.units import read_quantity

from .terminal import Presentation, option, print_progress, verb
from .verbs import LoopFile, LoopGain, McapFile, load_loop, refuse_existing, write_series

if TYPE_CHECKING:
    from pretouch.designs import Task
    from pretouch.recording import Recheck, Recording, Replay


@verb
def replay(
    shown: Presentation,
    *,
    file: LoopFile,
    recording: Annotated[
        Path,
        typer.Argument(metavar="BAG", help="ROS 2 bag (folder or file), MCAP file with JSON messages, or CSV file."),
    ],
    topic: Annotated[
        str,
        option(
            "TOPIC", 'Topic of the sensor, with a field and a unit if needed: "/joints.position[0]", "/laser [mm]".'
        ),
    ] = "",
    truth: Annotated[
        str | None, option("TOPIC", "Topic that is above --truth-above while there is an object or a contact.")
    ] = None,
    truth_above: Annotated[float, option("NUMBER", "Threshold of --truth.")] = 0.5,
    contacts: Annotated[
        str | None, option("TIMES", 'Times of true contacts after the first reading, such as "1.2 s, 4.7 s".')
    ] = None,
    before: Annotated[str, option("TIME", "Longest time from a detection to the contact that it announces.")] = "1 s",
    reference: Annotated[
        str | None,
        option("TOPIC", "Another topic of the same motion, such as a distance; needed to measure the latency."),
    ] = None,
    joints: Annotated[
        str | None, option("TOPIC", "Topic of joint states; with --model and --site, it replaces --reference.")
    ] = None,
    model: Annotated[
        Path | None, option("PATH", "Robot model (MJCF or URDF) that contains the object, for --joints.")
    ] = None,
    site: Annotated[str | None, option("NAME", "Site of the sensor in the model.")] = None,
    axis: Annotated[str, option("AXIS", "Axis of the site toward the object.")] = "+x",
    clock: Annotated[
        str | None, option("header|receive", "Which times to use; by default the header stamps, if there are any.")
    ] = None,
    rate: Annotated[
        str | None, option("RATE", 'Readings per second of a table without times, such as "100 Hz".')
    ] = None,
    start: Annotated[str | None, typer.Option("--from", metavar="TIME", help="Start of the replayed part.")] = None,
    end: Annotated[str | None, typer.Option("--to", metavar="TIME", help="End of the replayed part.")] = None,
    gain: LoopGain = None,
    chain: Annotated[Path | None, option("PATH", "Write the section [chain] of this sensor to a file.")] = None,
    calibration: Annotated[
        Path | None,
        option("PATH", "Write readings and distances of --reference or --joints as a calibration file (CSV)."),
    ] = None,
    mcap: McapFile = None,
    recheck: Annotated[
        bool,
        typer.Option("--recheck", help="Check whether the calibration of the scenario file still holds."),
    ] = False,
    distances: Annotated[
        str | None,
        option(
            "TIMES",
            'For --recheck, where the object was: "0-5 s: none, 8-12 s: 5 mm, 15-30 s: 40 to 5 mm"; instead of '
            "--reference.",
        ),
    ] = None,
    distance_error: Annotated[
        str, option("LENGTH", "For --recheck, standard deviation of a known distance.")
    ] = "0.5 mm",
    elapsed: Annotated[
        str | None,
        option("TIME", 'For --recheck, time from the calibration to the recording, such as "30 d".'),
    ] = None,
) -> None:
    """Run the control law of a scenario file on recorded sensor readings.

    Prints what the law detects, false triggers and missed contacts if the true ones are known, rate, gaps and noise of
    the sensor next to those of the scenario, and its lag behind another topic. Writes a report with figures,
    STEM-replay.html in this folder. The replay is open loop: the readings do not respond to the motion.

    With --recheck, the recording of today is compared with the calibration instead: offset, slope at known distances,
    noise, and what they do to the contact speed with the gain. The first sentence says "Fine", "Update the offset",
    "Recalibrate" or "Not decided".

    Exit status: 0 the law ran, 1 almost no reading could be used, less than half of the recording has one clock, or a
    known contact contradicts the detections, 2 a mistake in the request. With --recheck: 0 fine, 1 any other verdict.
    """
    from pretouch.recording import replay as run  # noqa: PLC0415 - keeps `pretouch --help` quick
    from pretouch.recording.known_distances import read_known_distances as read_distances  # noqa: PLC0415

    _refuse_swapped(file, recording)
    _refuse_incomplete(reference, joints, model, site)
    _refuse_without_recheck(recheck, distances, elapsed, [reference, joints])
    inputs = [path for path in recording.iterdir() if path.is_file()] if recording.is_dir() else [recording]
    for path in filter(None, (chain, calibration, mcap, shown.output)):
        refuse_input(path, [file, *inputs])
    for path in filter(None, (chain, calibration, mcap)):
        refuse_existing(path, force=shown.force)
    task = load_loop(file, "reading the recording", gain, None)
    sensor, *others = _recordings(recording, topic, [name for name in (reference, truth) if name], clock, rate)
    named = dict(zip([key for key, name in (("reference", reference), ("truth", truth)) if name], others, strict=True))
    if joints is not None and model is not None and site is not None:
        named["reference"] = _distances(recording, joints, model, site, axis=axis, clock=sensor.clock)
    print_progress(f"{recording}: replaying {len(sensor.stamps):,} readings")
    result = run(
        task,
        sensor,
        **named,
        threshold=truth_above,
        contacts=None if contacts is None else [_time(text, "--contacts") for text in contacts.split(",")],
        before=_time(before, "--before"),
        start=0.0 if start is None else _time(start, "--from"),
        end=float("inf") if end is None else _time(end, "--to"),
    )
    written = _write(result, shown, chain, calibration, mcap)
    answer: Replay | Recheck = result
    if recheck:
        known = None if distances is None else read_distances(distances, sensor)
        answer = _recheck(task, result, known, distance_error, elapsed)
    shown.show(
        answer,
        f"{recording.name.partition('.')[0] or 'recording'}-replay.html",
        task,
        lines=20,
        good=answer.is_good,
        inputs=inputs,
        files=written,
    )


def _refuse_swapped(file: Path, recording: Path) -> None:
    if file.suffix != ".toml" and recording.suffix == ".toml":
        raise InvalidInputError(
            f"{file}: found the recording first, expected the scenario file first. Run: "
            f"pretouch replay {recording} {file}"
        )


def _refuse_incomplete(reference: str | None, joints: str | None, model: Path | None, site: str | None) -> None:
    if joints is not None and reference is not None:
        raise InvalidInputError("--joints, --reference: found both, expected one of them")
    if len({joints is None, model is None, site is None}) > 1:
        raise InvalidInputError("--joints, --model, --site: expected all three of them, or none")


def _refuse_without_recheck(
    recheck: bool, distances: str | None, elapsed: str | None, others: list[str | None]
) -> None:
    for name, value in (("--distances", distances), ("--elapsed", elapsed)):
        if value is not None and not recheck:
            raise InvalidInputError(f"{name}: found without --recheck, expected with it; add --recheck")
    if distances is not None and any(others):
        raise InvalidInputError("--distances: found with --reference or --joints, expected one of them")


def _recheck(task: Task, result: Replay, distances: Recording | None, error: str, elapsed: str | None) -> Recheck:
    """Compare the recording with the calibration of the scenario."""
    from pretouch.recording.calibration_recheck import recheck as run  # noqa: PLC0415
    from pretouch.recording.known_distances import read_length  # noqa: PLC0415

    return run(
        task,
        result,
        distances=distances,
        distance_error=read_length(error, name="--distance-error"),
        elapsed=None if elapsed is None else _time(elapsed, "--elapsed"),
    )


def _recordings(
    path: Path, topic: str, others: list[str], clock: str | None, rate: str | None
) -> tuple[Recording, ...]:
    from pretouch.recording.reading import read_recordings  # noqa: PLC0415

    print_progress(f"{path}: reading")
    readings_per_second = None if rate is None else read_quantity(rate, "Hz", name="--rate")
    return read_recordings(path, (topic, *others), clock=clock, rate=readings_per_second)


def _distances(path: Path, joints: str, model: Path, site: str, *, axis: str, clock: str) -> Recording:
    """Compute distances from recorded joint states, a robot model and the clock of the sensor recording."""
    from pretouch.recording.joint_states import distances_from_joints  # noqa: PLC0415 - MuJoCo, only when needed
    from pretouch.robots import SensorSite, load_model  # noqa: PLC0415

    print_progress(f"{path}: distances from {joints}")
    return distances_from_joints(path, joints, load_model(model), SensorSite(site, axis=axis), clock=clock)


def _time(text: str, name: str) -> float:
    """Parse a time such as "1.2 s". A number without unit is in seconds."""
    return read_quantity(text, "s", name=name)


def _write(
    result: Replay, shown: Presentation, chain: Path | None, calibration: Path | None, mcap: Path | None
) -> tuple[str, ...]:
    """Write the requested output files of a replay. The result has a line of text about each file."""
    written = []
    pairs = None if calibration is None else result.pairs()  # before anything is written
    if chain is not None:
        if not result.chain:
            raise InvalidInputError(
                f"{chain}: the section [chain] cannot be estimated, because the recording has too few readings. "
                "Make a longer recording"
            )
        written.append(f"Section [chain]: {write_text(chain, result.chain, overwrite=shown.force)}")
    if calibration is not None and pairs is not None:
        write_text(calibration, pairs.as_csv(), overwrite=shown.force)
        removed = f", lag of {1e3 * pairs.shift:.3g} ms removed" if pairs.shift else ""
        written.append(f"Calibration{removed}: {calibration}")
    if mcap is not None:
        from pretouch.recording.mcap_output import series_of_replay  # noqa: PLC0415

        written.append(write_series(mcap, series_of_replay(result), force=shown.force))
    return tuple(written)
