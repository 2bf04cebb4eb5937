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

ROBOT_MODEL: Final = Section(
    {
        MODEL: Key(text('"arm.xml"'), REQUIRED, '"arm.xml"'),
        "site": Key(text('"fingertip"'), REQUIRED, '"fingertip"'),
        "axis": Key(_axis, "+x"),
        "field_of_view": Key(_ANGLE),
        "hold": Key(name_of("auto", "pose", "position", "axis"), "auto"),
        "keyframe": Key(_keyframe),
        "posture": Key(_table),
        "joint_speeds": Key(_table),
        "object_radius": Key(Quantity("m", '"35 mm"', "positive")),
        "follow_time": Key(Quantity("s", '"100 ms"', "nonnegative")),
    }
)
"""The keys of [robot] for a robot model in MuJoCo; other kinds of [robot] are plants of a sampled loop."""


def has_model(data: Mapping[str, Any]) -> bool:
    """Check whether a scenario file names a robot model."""
    robot = data.get("robot")
    return isinstance(robot, Mapping) and MODEL in robot
