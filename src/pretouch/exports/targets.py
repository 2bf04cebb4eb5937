"""Verify a control law, and export it for one target.

The targets are C, JSON, FMU, ROS 2 and Arduino.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.files import refuse_input
from pretouch._core.messages import not_one_of
from pretouch.control import Limits
from pretouch.designs import Task

from .arduino import arduino_files, check_arduino
from .c import c_files
from .fmu import fmu_files, fmu_kind
from .folder import check_free, write_folder
from .json import json_files
from .law_design import LawDesign, law_design
from .result import Export
from .ros2 import ros2_files


class _Target(NamedTuple):
    """Name, file generator and requirements of an export target.

    Args:
        kind: returns the name of the format.
        files: returns the content of each file by its path in the folder.
        check: raises an error for a task that this target cannot run, before the task is verified.
    """

    kind: Callable[[], str]
    files: Callable[[LawDesign], Mapping[str, str | bytes]]
    check: Callable[[Task], None] = lambda _: None


TARGETS: Final = {
    "arduino": _Target(lambda: "Arduino library", arduino_files, check_arduino),
    "c": _Target(lambda: "C", c_files),
    "fmu": _Target(fmu_kind, fmu_files),
    "json": _Target(lambda: "JSON", json_files),
    "ros2": _Target(lambda: "ROS 2 package", ros2_files),
}
"""The targets of exports by their names."""


@check_arguments
def export(
    task: Task,
    folder: str | os.PathLike[str],
    target: str = "c",
    *,
    verify: bool = True,
    toward_object: bool = False,
    date: str | None = None,
    overwrite: bool = False,
) -> Export:
    """Verify the gain of a task, and export the control law.

    If the verification does not confirm the gain, nothing is exported. Every folder contains the law, the constants of
    this design, test vectors from a simulation, a test that replays them, and instructions.

    Args:
        task: the encounter with its sampled loop; the gain as for `verify`.
        folder: the new folder; it is complete or does not exist.
        target: "c" for C99 source, which is the very source that simulations run; "json" for parameters and difference
            equations for MATLAB, Octave and PLCs; "fmu" for co-simulation units, one for FMI 2.0 and one for FMI 3.0;
            "ros2" for a package with a chainable controller for ros2_control (ROS 2 Jazzy and later); "arduino" for a
            library whose example reads a sensor, runs the law and writes a reference for a drive.
        verify: whether to verify the gain first. Without it, the files say that the gain was not verified.
        toward_object: whether a law that is not verified may pull the robot toward the object. By default, such a law
            is refused, as its gain has the wrong sign.
        date: date of the verification as text, which the files state.
        overwrite: whether an unchanged folder of an earlier export may be replaced.

    Returns:
        The result: what was written, or why nothing was written.

    Raises:
        InvalidInputError: the target is unknown, the folder may not be replaced, the law has no C source, the target
            cannot read the sensor at its rate, or the law is not verified and pulls the robot toward the object.
    """
    if target not in TARGETS:
        raise InvalidInputError(**not_one_of("target", target, TARGETS))
    kind, make, check = TARGETS[target]
    source: Any = task.source
    refuse_input(folder, getattr(source, "inputs", ()))
    check_free(folder, overwrite=overwrite)  # before the verification, which takes seconds
    check(task)
    design = law_design(task, verify=verify, toward_object=toward_object, date=date)
    files: tuple[Path, ...] = ()
    if design.is_supported or not verify:
        content = {name: text.encode() if isinstance(text, str) else text for name, text in make(design).items()}
        files = write_folder(folder, content, overwrite=overwrite)
    return Export(
        kind=kind(),
        folder=Path(folder),
        files=files,
        law=design.law_text,
        verdict=design.verdict,
        is_limited=design.controller.limits != Limits(),
        is_idle=design.controller.law.value == 0,
        attraction=design.attraction,
        warnings=task.warnings,
    )
