"""[law]: of which law a gain is the number, what the drag is chosen by, and how it is sampled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pretouch.control import VirtualDrag
from pretouch.design import DragEffect
from pretouch.motion.laws import DRAG
from pretouch.motion.scenario import Scenario

from .loop_sections import AT_A_SPEED, OF_CHAIN, SAMPLED_DRAG
from .section import EFFECTS

if TYPE_CHECKING:
    from pretouch.simulation import SensorChain

    from .reading import Reading


def law_fields(
    file: Reading, scenario: Scenario | None, uncertain: Mapping[str, Any], has_loop: bool
) -> dict[str, Any]:
    """Return the fields of a task that speak of a drag; none for the damper, and where there are mistakes."""
    given = file.values("law")
    if file.kind != DRAG.kind or given is None:
        return {}
    if not has_loop:
        for name in SAMPLED_DRAG:
            if name in file.data["law"] and name != "drag":
                file.refuse(("law", name), "found a key of the sampled drag, expected [chain] and [controller] with it")
    found = {name: given[name] for name in EFFECTS if name in given}
    if not found:
        return {"law": DRAG, "gain": given.get("drag")}
    if set(found) & set(AT_A_SPEED) and "largest_speed" not in given and scenario is not None:
        known = not any(name.endswith(".velocity") for name in uncertain)
        if not (known and scenario.relative_velocity < 0):
            why = "the obstacle does not approach" if known else "how fast the obstacle comes is uncertain"
            file.refuse(
                ("law", "largest_speed"),
                "missing, expected the largest approach speed up to which the limit is kept, since "
                f'{why}; add, for example: largest_speed = "0.5 m/s"',
            )
    speed = given.get("largest_speed")
    return {"law": DRAG, "effect": file.attempt("law", lambda: DragEffect(**found, largest_speed=speed))}


def sampled_drag(file: Reading, chain: SensorChain) -> VirtualDrag | None:
    """Build the sampled drag, which knows the noise of the chain where the file names no other."""
    given = file.values("law")
    if given is None:
        return None
    if chain.reports_distance and chain.distance_noise > 0 and "noise" not in given:
        file.refuse(
            ("law", "noise"),
            "missing, expected a sensor output: the chain knows the noise of distances, not that of readings",
        )
        return None
    own = {name: getattr(chain, name) for name in OF_CHAIN} | {k: v for k, v in given.items() if k in SAMPLED_DRAG}
    return file.attempt("law", lambda: VirtualDrag(**{"drag": 0.0, **own}))
