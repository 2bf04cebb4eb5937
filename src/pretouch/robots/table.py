"""Compute the mass and limits of a robot at all sites.

The overview covers all postures and axes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

from pretouch._core.arguments import check_arguments
from pretouch._core.display import Described
from pretouch._core.errors import InvalidInputError
from pretouch._core.values import Value

from .model import Model, check_model, make_data, names_of
from .projection import Projection, project_site
from .site import SensorSite

REFERENCE: Final = "reference"
"""The name of the posture in which the model is defined."""

_AXES: Final = ("+x", "+y", "+z")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectionRow(Value):
    """Mass and limits of a robot at one site and posture.

    They count along one axis of the site.

    Args:
        site: name of the site.
        posture: name of the keyframe, or "reference".
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
def project(model: Model) -> ProjectionTable:
    """Compute mass and limits of a robot at every named site.

    They count along the site's own axes x, y and z. The postures are that in which the model is defined, and its
    keyframes. A row also covers the opposite axis, with its limits ahead and back exchanged.

    Args:
        model: a `mujoco.MjModel`, such as from `load_model`.

    Returns:
        The overview.

    Raises:
        InvalidInputError: this is no model, the model has no named site, or no site can be projected in any posture.
    """
    check_model(model)
    sites = [name for name in names_of(model, "site") if name]
    if not sites:
        raise InvalidInputError("site: the model has no site with a name; add <site name=... pos=.../> to a body")
    rows = tuple(_rows(model, sites))
    if all(row.projection is None for row in rows):
        reason = rows[0].reason.removeprefix("site: ")
        raise InvalidInputError(
            f"site: mass and limits cannot be computed for any site of the model. Reason for the first site: {reason}"
        )
    return ProjectionTable(model=_name_of(model), rows=rows)


def _rows(model: Model, sites: list[str]) -> Iterator[ProjectionRow]:
    keyframes = [name or str(i) for i, name in enumerate(names_of(model, "key"))]
    postures = [(REFERENCE, make_data(model)), *((k, make_data(model, keyframe=i)) for i, k in enumerate(keyframes))]
    for site in sites:
        for posture, data in postures:
            for axis in _AXES:
                row = ProjectionRow(site=site, posture=posture, axis=axis, projection=None)
                try:
                    yield replace(row, projection=project_site(model, data, SensorSite(site, axis=axis)))
                except InvalidInputError as error:
                    yield replace(row, reason=str(error))


def _name_of(model: Model) -> str:
    """Return the name of a model, as its file states it."""
    return bytes(model.names).split(b"\0", 1)[0].decode("utf-8", "replace")
