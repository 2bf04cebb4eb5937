"""Write time series to an MCAP file with a Foxglove layout.

The time series come from a replay or a simulation. The layout plots them.
"""

from __future__ import annotations

import io
import json
import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from pretouch._core.errors import require
from pretouch._core.files import write_bytes, write_text
from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Value
from pretouch.control import Status
from pretouch.simulation import LoopTrace

from .containers import EXTRA
from .result import Replay

LAW: Final = "/pretouch/law"
ENCOUNTER: Final = "/pretouch/encounter"

_MEANING: Final = {
    "reading": "newest reading of the law, in the unit of the sensor output",
    "xi": "sensor output after offset and filters; 0 if nothing is detected",
    "log_level": "ln(xi / floor); 0 if nothing is detected",
    "detected": "whether the law detects an object",
    "virtual_force": "virtual force F_p [N]",
    "position": "commanded position x_v [m]",
    "velocity": "commanded velocity x_v' [m/s]",
    "status": "sum of the status flags of the law",
    "distance": "distance l [m]",
    "robot_position": "position of the robot [m]",
    "robot_velocity": "velocity of the robot [m/s]",
    "obstacle_position": "position of the obstacle [m]",
    "contact_force": "contact force [N]",
}
_PLOTS: Final = (
    ("Sensor reading", (LAW, "reading")),
    ("Sensor output \u03be", (LAW, "xi")),
    ("Detection", (LAW, "detected")),
    ("Virtual force [N]", (LAW, "virtual_force")),
    ("Commanded motion [m]", (LAW, "position")),
    ("Distance [m]", (ENCOUNTER, "distance")),
    ("Contact force [N]", (ENCOUNTER, "contact_force")),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Series(Value):
    """Time series of one topic of an MCAP file.

    Args:
        topic: name of the topic.
        stamps: time of each message [ns].
        columns: values of each message by name, all of the same length.
    """

    topic: str
    stamps: IntArray
    columns: Mapping[str, Any]


def series_of_replay(replay: Replay) -> tuple[Series, ...]:
    """Return the time series of the control law in a replay.

    They contain the inputs and outputs of the law, on the clock of the recording.

    Args:
        replay: the replay.
    """
    steps = replay.steps
    stamps = int(replay.recording.stamps[0]) + np.round(1e9 * steps.time).astype(np.int64)
    columns = {name: getattr(steps, name) for name in ("reading", "virtual_force", "position", "velocity")}
    floor = replay.controller.conditioning.floor
    return (Series(topic=LAW, stamps=stamps, columns=_law_columns(steps.log_level, steps.status, floor, columns)),)


def series_of_trace(trace: LoopTrace, floor: float) -> tuple[Series, ...]:
    """Return the time series of a simulated run.

    They describe the control law, the robot and the obstacle.

    Args:
        trace: the run.
        floor: detection threshold of the controller [unit of xi].
    """
    stamps = np.round(1e9 * trace.time).astype(np.int64)
    commanded = {"position": trace.virtual_position, "velocity": trace.virtual_velocity}
    columns = {"reading": trace.reading, "virtual_force": trace.virtual_force, **commanded}
    status = trace.flags.astype(np.int64)
    encounter = {
        "distance": trace.distance,
        "robot_position": trace.position,
        "robot_velocity": trace.velocity,
        "obstacle_position": trace.obstacle_position,
        "contact_force": trace.contact_force,
    }
    return (
        Series(topic=LAW, stamps=stamps, columns=_law_columns(trace.log_level, status, floor, columns)),
        Series(topic=ENCOUNTER, stamps=stamps, columns=encounter),
    )


def _law_columns(log_level: FloatArray, status: IntArray, floor: float, columns: Mapping[str, Any]) -> dict[str, Any]:
    detected = (status & Status.DETECTING) != 0
    xi = np.where(detected, floor * np.exp(log_level), 0.0)
    return {**columns, "xi": xi, "log_level": log_level, "detected": detected, "status": status}


def write_mcap(path: str | os.PathLike[str], series: Iterable[Series], *, overwrite: bool = False) -> tuple[Path, Path]:
    """Write time series to an MCAP file and a Foxglove layout.

    The layout plots the time series and is in the same folder. Both files are written completely or not at all; numbers
    that are not finite are left out of their message.

    Args:
        path: the MCAP file.
        series: the time series.
        overwrite: whether existing files may be replaced.

    Returns:
        The paths of the MCAP file and of the layout.
    """
    shown = tuple(series)
    target = Path(path)
    layout = layout_path(target)
    content = _content(shown)
    write_bytes(target, content, overwrite=overwrite)
    write_text(layout, json.dumps(_layout(shown), indent=2) + "\n", overwrite=overwrite)
    return target, layout


def layout_path(path: Path) -> Path:
    """Return the path of the Foxglove layout for an MCAP file.

    Args:
        path: the MCAP file.
    """
    return path.with_name(f"{path.stem}.foxglove.json")


def _content(series: tuple[Series, ...]) -> bytes:
    """Return time series as the content of an MCAP file."""
    library = require("mcap.writer", extra=EXTRA)
    stream = io.BytesIO()
    writer = library.Writer(stream)
    writer.start(profile="", library="pretouch")
    rows: list[tuple[int, int, bytes]] = []
    for each in series:
        schema = writer.register_schema(each.topic.strip("/").replace("/", "."), "jsonschema", _schema(each))
        channel = writer.register_channel(each.topic, "json", schema)
        rows += [(stamp, channel, text) for stamp, text in zip(each.stamps.tolist(), _messages(each), strict=True)]
    rows.sort(key=lambda row: row[:2])
    for stamp, channel, text in rows:
        writer.add_message(channel, log_time=stamp, publish_time=stamp, data=text)
    writer.finish()
    return stream.getvalue()


def _schema(series: Series) -> bytes:
    kinds = {"b": "boolean", "i": "integer"}
    properties = {
        name: {"type": kinds.get(np.asarray(column).dtype.kind, "number"), "description": _MEANING[name]}
        for name, column in series.columns.items()
    }
    return json.dumps({"type": "object", "properties": properties}).encode()


def _messages(series: Series) -> Iterable[bytes]:
    """Yield the messages of a topic as JSON.

    JSON has no NaN. A number that is not finite is left out, because Foxglove reads no schema that allows null.
    """
    names = list(series.columns)
    columns = [np.asarray(column) for column in series.columns.values()]
    finite = [np.isfinite(column).all() if column.dtype.kind == "f" else True for column in columns]
    rows = zip(*(column.tolist() for column in columns), strict=True)
    for row in rows:
        message = dict(zip(names, row, strict=True))
        if not all(finite):
            message = {name: value for name, value in message.items() if math.isfinite(value)}
        yield json.dumps(message).encode()


def _layout(series: tuple[Series, ...]) -> dict[str, Any]:
    """Return a Foxglove layout that shows the plots one below the other."""
    topics = {each.topic for each in series}
    plots = [(title, path) for title, path in _PLOTS if path[0] in topics]
    panels = {
        f"Plot!pretouch{i}": {
            "paths": [{"value": ".".join(path), "enabled": True, "timestampMethod": "receiveTime"}],
            "foxglovePanelTitle": title,
            "showXAxisLabels": True,
            "showYAxisLabels": True,
            "showLegend": False,
            "isSynced": True,
            "xAxisVal": "timestamp",
        }
        for i, (title, path) in enumerate(plots)
    }
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _stacked(list(panels)),
    }


def _stacked(names: list[str]) -> Any:
    """Stack Foxglove panels of equal height."""
    if len(names) == 1:
        return names[0]
    share = 100 / len(names)
    return {"first": names[0], "second": _stacked(names[1:]), "direction": "column", "splitPercentage": share}
