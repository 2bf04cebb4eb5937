"""Report the mass and the limits of a robot along sensor axes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from pretouch._core.blocks import Cell, Listing, Measured, Page, PageTable
from pretouch._core.units import format_quantity
from pretouch._core.warning_codes import with_context

from .deviations import with_curved_paths_last
from .drives import AxisLimits
from .projection import Projection
from .table import ProjectionRow, ProjectionTable

_NO_LIMIT = "no limit"
_OF_COLUMNS = ("PT502", "PT627")  # warnings that explain columns of the table, which the terminal always shows
_FAST = (
    "The model limits torques but no speed. If your drives have limits, set joint_speeds, such as "
    '{ elbow = "90 deg/s" }.'
)


def projection_page(projection: Projection) -> Page:
    """Report the mass and limits of a robot along a sensor axis."""
    p = projection
    back, ahead = p.excursion[1], p.excursion[0]
    return Page(
        kind="Projection of a robot",
        headline=(
            f"Site {p.site.name} along its axis {_axis(p)}: reflected mass {format_quantity(p.reflected_mass, 'kg')}, "
            f"longest retreat {format_quantity(back.length, 'm')}."
        ),
        warnings=p.warnings,
        key_figures=tuple(_figures(p)),
        blocks=(
            PageTable(rows=tuple(_figures(p)), brief=True),
            PageTable(
                head=("", "ahead", "back"),
                rows=(
                    ("excursion", Measured(ahead.length, "m"), Measured(back.length, "m")),
                    ("ends at", ahead.reason, back.reason),
                    *(
                        (name, *_span(span, unit))
                        for name, span, unit in (
                            ("acceleration", p.acceleration, "m/s^2"),
                            ("speed", p.speed, "m/s"),
                            ("static force", p.force, "N"),
                        )
                    ),
                    *_reasons(p),
                ),
                brief=True,
            ),
        ),
    )


def _reasons(p: Projection) -> Iterator[tuple[Cell, ...]]:
    """Yield what limits acceleration, speed and force, if something does."""
    for name, span in (("acceleration", p.acceleration), ("speed", p.speed), ("static force", p.force)):
        if any(span.reasons):
            yield f"{name} limited by", *(reason or "-" for reason in span.reasons)


def table_page(table: ProjectionTable) -> Page:
    """Report the mass and limits of a robot at all sites.

    Returns:
        The report, which covers all postures of the model.
    """
    rows = table.projections
    sites = len({row.site for row, _ in rows})
    fast = any(math.isinf(p.speed.least) for _, p in rows)
    reasons = tuple(_missing(table.rows))
    head = ("site", "posture", "axis", "mass", "retreat", "ahead", "acceleration", "speed", "force", "conditioning")
    common = [w for w in (rows[0][1].warnings if rows else ()) if all(w in p.warnings for _, p in rows)]
    listed = dict.fromkeys(w for _, p in rows for w in p.warnings if w.startswith(_OF_COLUMNS))
    warnings = dict.fromkeys(common) | dict.fromkeys(
        with_context(f"{row.site}, {row.posture}, {row.axis}", warning)
        for row, p in rows
        for warning in p.warnings
        if warning not in common
    )
    return Page(
        kind="Robot model",
        headline=f"{table.model}: {_count(len(rows), 'projection')} of {_count(sites, 'site')}.",
        warnings=with_curved_paths_last(warnings),
        findings=(*((_FAST,) if fast else ()), *(warning.partition(": ")[2] for warning in listed)),
        blocks=(
            PageTable(head=head, rows=tuple(_cells(*row) for row in rows), brief=True),
            *((PageTable(head=("site", "without numbers", "reason"), rows=reasons, brief=True),) if reasons else ()),
            *((Listing(items=(_FAST,), brief=True),) if fast else ()),
        ),
    )


def _missing(rows: Sequence[ProjectionRow]) -> Iterator[tuple[Cell, ...]]:
    """Yield the site, the postures and axes, and the reason of rows without a projection."""
    missing: dict[tuple[str, str], list[ProjectionRow]] = {}
    for row in rows:
        if row.projection is None:
            reason = row.reason.removeprefix(f"site {row.site!r}: ").removeprefix("site: ")
            missing.setdefault((row.site, reason), []).append(row)
    for (site, reason), group in missing.items():
        every = sum(row.site == site for row in rows) == len(group)
        yield site, "all" if every else ", ".join(f"{row.posture} {row.axis}" for row in group), reason


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _cells(row: ProjectionRow, p: Projection) -> tuple[Cell, ...]:
    return (
        row.site,
        row.posture,
        row.axis,
        Measured(p.reflected_mass, "kg", 3),
        Measured(p.retreat, "m", 3),
        Measured(p.excursion[0].length, "m", 3),
        *(_limit(span.least, unit) for span, unit in ((p.acceleration, "m/s^2"), (p.speed, "m/s"), (p.force, "N"))),
        Measured(p.conditioning, "", 2),
    )


def _figures(p: Projection) -> Iterator[tuple[str, Cell]]:
    yield "reflected mass", Measured(p.reflected_mass, "kg")
    yield f"mass moved by the drives along the axis (hold option: {p.hold})", Measured(p.moved_mass, "kg")
    if p.followers:
        yield "joints that follow by constraints of the model", ", ".join(p.followers)
    if p.support:
        yield "contacts on which the robot stands, fixed in this report", ", ".join(p.support)
        if math.isfinite(p.support_limit):
            yield "push on the site from which a contact lifts or slides", Measured(p.support_limit, "N")
        yield "reflected mass if these contacts do not hold", Measured(p.unsupported_mass, "kg")
    if p.lag > 0:
        yield "lag of the drives", Measured(p.lag, "s", 3)
    if p.base:
        yield "recoil share \u03ba of the base", Measured(p.recoil_share)
    yield "conditioning (1 best, 0 singular)", Measured(p.conditioning)


def _span(span: AxisLimits, unit: str) -> tuple[Cell, Cell]:
    return _limit(span.ahead, unit), _limit(span.back, unit)


def _limit(value: float, unit: str) -> Cell:
    return Measured(value, unit, 3) if math.isfinite(value) else _NO_LIMIT


def _axis(p: Projection) -> str:
    if isinstance(p.site.axis, str):
        return p.site.axis
    return "(" + ", ".join(f"{v:g}" for v in p.site.axis) + ")"
