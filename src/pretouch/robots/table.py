"""Compute the mass and limits of a robot at all sites.

The overview covers all postures and axes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError
from pretouch._core.values import Value
from pretouch._core.warning_codes import caution

from .dynamics import actuator_moment
from .model import (
    Data,
    Model,
    check_model,
    is_scalar_joint,
    joint_label,
    make_data,
    mujoco,
    names_of,
    range_of,
    site_index,
)
from .projection import Projection, project_site
from .site import SensorSite

REFERENCE: Final = "reference"
"""The name of the posture in which the model is defined."""

MIDDLE: Final = "mid-range"
"""The name of this posture if it is outside joint ranges: these joints then stand in the middle of their ranges."""

GIVEN: Final = "given"
"""The name of a posture that the user states."""

_AXES: Final = ("+x", "+y", "+z")
_LISTED: Final = 3  # reasons of an error
_ENDS: Final = 8  # bodies of an error


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectionRow(Value):
    """Mass and limits of a robot at one site and posture.

    They count along one axis of the site.

    Args:
        site: name of the site.
        posture: name of the keyframe, "reference", "mid-range" or "given".
        axis: axis in the frame of the site.
        projection: the projection; None if there is none.
        reason: why there is no projection; empty if there is one.
    """

    site: str
    posture: str
    axis: str
    projection: Projection | None
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectionTable(Described, Value):
    """Mass and limits of a robot at all sites and postures.

    They count along each site's own axes.

    Args:
        model: name of the model.
        rows: the rows, in the order of sites, postures and axes.
    """

    model: str
    rows: tuple[ProjectionRow, ...]

    @property
    def projections(self) -> tuple[tuple[ProjectionRow, Projection], ...]:
        """The rows that have a projection, each with its projection.

        Each pair has the row first.
        """
        return tuple((row, row.projection) for row in self.rows if row.projection is not None)

    def to_dict(self) -> dict[str, Any]:
        """Return mass and limits at all sites as a dictionary for JSON.

        All values are in SI units. Reasons stand for missing projections.
        """
        return {"model": self.model, "rows": list(map(_row_as_dict, self.rows))}


def _row_as_dict(row: ProjectionRow) -> dict[str, Any]:
    if row.projection is None:
        return {"site": row.site, "keyframe": row.posture, "site_axis": row.axis, "error": row.reason}
    return {"keyframe": row.posture, **row.projection.to_dict()}


@check_arguments
def project(
    model: Model, sites: Sequence[SensorSite] = (), posture: Mapping[str, Any] | None = None
) -> ProjectionTable:
    """Compute mass and limits of a robot at its named sites.

    By default, they count along the axes x, y and z of every named site. A row also covers the opposite axis, with its
    limits ahead and back exchanged. The postures are that in which the model is defined, and its keyframes. If a driven
    joint is outside its range in the former, such joints stand in the middle of their ranges instead, and the posture
    is called "mid-range".

    Args:
        model: a `mujoco.MjModel`, such as from `load_model`.
        sites: the sites, each with one axis; by default all.
        posture: positions of joints by name, as in `make_data`; by default all postures of the model.

    Returns:
        The overview.

    Raises:
        InvalidInputError: this is no model, the model has no named site, or no site can be projected in any posture.
    """
    check_model(model)
    asked = tuple(sites) or tuple(
        SensorSite(name, axis=axis) for name in names_of(model, "site") if name for axis in _AXES
    )
    if not asked:
        raise InvalidInputError(
            "site: the model has no site with a name; choose a body and a direction, such as --site "
            f"{(*_ends(model), 'BODY')[0]}:+z. {_ends_sentence(model)}"
        )
    for site in asked:
        site_index(model, site.name)
    rows = tuple(_rows(model, asked, _postures(model, posture)))
    if all(row.projection is None for row in rows):
        raise InvalidInputError(f"site: mass and limits cannot be computed for any site of the model. {_reasons(rows)}")
    return ProjectionTable(model=_name_of(model), rows=rows)


def _reasons(rows: Sequence[ProjectionRow]) -> str:
    """Return the different reasons why sites have no projection, the most frequent first."""
    counts = Counter(row.reason.removeprefix(f"site {row.site!r}: ").removeprefix("site: ") for row in rows)
    fixed = [reason for reason in counts if "fixed to the world" in reason]
    ordered = [reason for reason, _ in counts.most_common() if reason not in fixed] or fixed
    sites = [next(row.site for row in rows if reason in row.reason) for reason in ordered[:_LISTED]]
    return "; ".join(f"{site}: {reason}" for site, reason in zip(sites, ordered, strict=False))


def _ends(model: Model) -> list[str]:
    """Return the names of moving bodies that carry no other body."""
    parents, names = set(np.asarray(model.body_parentid).tolist()), names_of(model, "body")
    return [
        name for body, name in enumerate(names) if name and body not in parents and int(model.body_treeid[body]) >= 0
    ][:_ENDS]


def _ends_sentence(model: Model) -> str:
    ends = ", ".join(_ends(model))
    return f"Bodies at the ends of the robot: {ends}" if ends else "No body of the model moves"


@dataclass(frozen=True, slots=True)
class _Posture:
    """A posture of the table, with its state and warnings."""

    name: str
    data: Data
    warnings: tuple[str, ...] = ()


def _postures(model: Model, posture: Mapping[str, Any] | None) -> list[_Posture]:
    if posture:
        return [_Posture(GIVEN, make_data(model, posture))]
    keyframes = [name or str(i) for i, name in enumerate(names_of(model, "key"))]
    return [
        _reference(model),
        *(_Posture(name, make_data(model, keyframe=i)) for i, name in enumerate(keyframes)),
    ]


def _reference(model: Model) -> _Posture:
    """Return the posture in which a model is defined, with its driven joints inside their ranges."""
    data = make_data(model)
    driven = np.abs(actuator_moment(model, data)).max(axis=0, initial=0.0) > 0
    outside: dict[int, float] = {}
    for joint in np.flatnonzero(np.asarray(model.jnt_limited)):
        low, high = range_of(model, int(joint))
        place = data.qpos[model.jnt_qposadr[joint]]
        if is_scalar_joint(model, int(joint)) and driven[model.jnt_dofadr[joint]] and not low <= place <= high:
            outside[int(joint)] = (low + high) / 2
    if not outside:
        return _Posture(REFERENCE, data)
    for index, middle in outside.items():
        data.qpos[model.jnt_qposadr[index]] = middle
    mujoco().mj_forward(model, data)
    names = ", ".join(joint_label(model, index) for index in outside)
    warning = caution(
        "PT543",
        f"The posture in which the model is defined is outside the ranges of the joints {names}, so pretouch puts "
        "them in the middle: choose a posture with --posture, or add a keyframe to the model.",
    )
    return _Posture(MIDDLE, data, (warning,))


def _rows(model: Model, sites: Sequence[SensorSite], postures: Sequence[_Posture]) -> Iterator[ProjectionRow]:
    names = dict.fromkeys(site.name for site in sites)
    for name in names:
        for posture in postures:
            for site in (site for site in sites if site.name == name):
                row = ProjectionRow(site=name, posture=posture.name, axis=str(site.axis), projection=None)
                try:
                    found = project_site(model, posture.data, site)
                except InvalidInputError as error:
                    yield replace(row, reason=str(error))
                else:
                    yield replace(row, projection=replace(found, warnings=(*posture.warnings, *found.warnings)))


def _name_of(model: Model) -> str:
    """Return the name of a model, as its file states it."""
    return bytes(model.names).split(b"\0", 1)[0].decode("utf-8", "replace")
