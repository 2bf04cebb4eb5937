"""Read a robot model that a scenario file names, and project the robot to the axis of its sensor."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pretouch._core.errors import InvalidInputError

from .reading import Reading
from .robot_section import MODEL, has_model

if TYPE_CHECKING:
    from pretouch.robots import Projection


def project_robot(file: Reading) -> Projection | None:
    """Project the robot model of a scenario file; None if the file names none, or if the section has a mistake."""
    values = file.values("robot")
    if values is None or not has_model(file.data):
        return None
    return file.attempt("robot", lambda: _project(file, values))


def _project(file: Reading, values: Mapping[str, Any]) -> Projection:
    from pretouch.robots import SensorSite, load_model, make_data, project  # noqa: PLC0415 - only with a robot model

    path = file.source.path.parent / values[MODEL]
    try:
        model = load_model(path)
    except InvalidInputError:
        # A scenario may name any file, so the message must not reveal its content.
        if not path.is_file():
            raise
        raise InvalidInputError(
            f"model: MuJoCo cannot read {path.name}; to see more, run: pretouch project {shlex.quote(str(path))}"
        ) from None
    file.source = replace(file.source, model_files=(path,))
    options = {name: values[name] for name in ("axis", "field_of_view", "hold") if name in values}
    site = SensorSite(values["site"], **options)
    data = make_data(model, values.get("posture"), keyframe=values.get("keyframe"))
    return project(model, data, site, joint_speeds=values.get("joint_speeds"))
