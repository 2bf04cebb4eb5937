"""Compute object distances from recorded joint states and a robot model."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch.robots import SensorSite
from pretouch.robots.joint_distances import distances_ahead

from .columns import is_table
from .containers import read_contents
from .decoding import decode_names
from .reading import decode_topic, read_recordings
from .recording import Recording

_MOST: Final = 20_000  # joint states that are converted, since a calibration has no more rows


@check_arguments
def distances_from_joints(
    path: str | os.PathLike[str], topic: str, model: Any, site: SensorSite, *, clock: str | None = None
) -> Recording:
    """Compute the distances from a robot's sensor to an object.

    The joint states come from a recording. The model contains the object, such as a wall or a box, at its place during
    the recording. The distance is that along the axis of the sensor, from its site to the first object.

    Args:
        path: see `read_recording`.
        topic: topic of type sensor_msgs/JointState, or of JSON messages with the lists "name" and "position".
        model: the `mujoco.MjModel`.
        site: the sensor; its curve is not used.
        clock: see `read_recording`.

    Returns:
        The distances [m]; of more than 20,000 joint states, every n-th.
    """
    file = Path(path)
    names = _joint_names(file, topic)
    columns = read_recordings(file, tuple(f"{topic}.position[{i}]" for i in range(len(names))), clock=clock)
    every = -(-len(columns[0].stamps) // _MOST)
    chosen = columns[0].part(slice(None, None, every))
    joints = {name: column.values[::every] for name, column in zip(names, columns, strict=True)}
    notes = (f"Only one of every {every} joint states was used.",) if every > 1 else ()
    return replace(
        chosen,
        topic=f"{topic} ({site.name})",
        values=distances_ahead(model, site, joints),
        kind="distance",
        notes=(*chosen.notes, *notes),
    )


def _joint_names(file: Path, topic: str) -> tuple[str, ...]:
    """Read the joint names from the joint states of a topic."""
    if is_table(file):
        raise InvalidInputError(
            f"{file}: this is a CSV file, but pretouch reads joint states only from ROS 2 bags and MCAP files. Add a "
            "column with the distances to the CSV file, and choose this column as the reference"
        )
    first = f"{topic}.position[0]"
    messages, _ = decode_topic(read_contents(file, [first]), first, file.name)
    return decode_names(messages)
