"""Define the scenario-file keys of a robot model in MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from .quantities import Quantity, UnfitValueError
from .section import REQUIRED, Key, Section, checked, name_of, text

MODEL: Final = "model"
"""The key of [robot] that names the file of a robot model."""

_ANGLE: Final = Quantity("", '"8 deg"', "nonnegative")


def _axis(value: Any) -> Any:
    """Parse the axis of a sensor. The axis is a name such as "+x" or a list of three numbers."""
    if not isinstance(value, str | list):
        raise UnfitValueError('expected an axis of the site such as "+x", or a list of three numbers')
    return tuple(value) if isinstance(value, list) else value


_table: Final = checked(
    lambda v: isinstance(v, Mapping) and all(type(x) in {str, int, float} for x in v.values()),
    'a table of joints, such as { elbow = "45 deg" }',
)
_keyframe: Final = checked(lambda v: isinstance(v, str | int) and not isinstance(v, bool), "a keyframe of the model")

_names: Final = checked(
    lambda v: isinstance(v, list) and bool(v) and all(isinstance(x, str) for x in v),
    'a list of names, such as ["shoulder", "elbow"]',
)


_LENGTH: Final = Quantity("m", '"50 mm"')


def _offset(value: Any) -> Any:
    """Parse the distance of a sensor from the origin of its body along its axis, or its position in three lengths."""
    return tuple(map(_LENGTH, value)) if isinstance(value, list) else _LENGTH(value)


def _check_place(values: Mapping[str, Any]) -> None:
    """Check that a section states one place of the sensor."""
    if ("site" in values) == ("body" in values):
        found = "both site and body" if "site" in values else "neither site nor body"
        raise UnfitValueError(
            f'found {found}, expected one of them: site = "fingertip" for a site of the model, or body = "wrist" with '
            'axis = "+z" and offset = "50 mm"',
            "site",
        )
    if "body" not in values and "offset" in values:
        raise UnfitValueError("found offset without body; a site of the model has its own position", "offset")
    if "body" in values and not isinstance(values.get("axis", "+x"), str):
        raise UnfitValueError('expected an axis of the body such as "+x" together with body', "axis")


ROBOT_MODEL: Final = Section(
    {
        MODEL: Key(text('"arm.xml"'), REQUIRED, '"arm.xml"'),
        "site": Key(text('"fingertip"')),
        "body": Key(text('"wrist_3_link"')),
        "axis": Key(_axis, "+x"),
        "offset": Key(_offset),
        "base": Key(name_of("fixed", "free")),
        "joints": Key(_names),
        "packages": Key(_names),
        "field_of_view": Key(_ANGLE),
        "hold": Key(name_of("auto", "pose", "position", "axis"), "auto"),
        "keyframe": Key(_keyframe),
        "posture": Key(_table),
        "joint_speeds": Key(_table),
        "object_radius": Key(Quantity("m", '"35 mm"', "positive")),
        "follow_time": Key(Quantity("s", '"100 ms"', "nonnegative")),
    },
    check=_check_place,
)
"""The keys of [robot] for a robot model in MuJoCo; other kinds of [robot] are plants of a sampled loop."""


def has_model(data: Mapping[str, Any]) -> bool:
    """Check whether a scenario file names a robot model."""
    robot = data.get("robot")
    return isinstance(robot, Mapping) and MODEL in robot
