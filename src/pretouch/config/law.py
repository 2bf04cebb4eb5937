"""Create the control law from the section `[law]` of a scenario file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pretouch.control import Law, VirtualDrag
from pretouch.designs import DragEffect
from pretouch.motion.laws import DAMPER, DRAG
from pretouch.motion.scenario import Scenario

from .loop_sections import AT_A_SPEED, FROM_CHAIN, SAMPLED_DRAG
from .section import EFFECTS

if TYPE_CHECKING:
    from pretouch.simulation import SensorChain

    from .reading import Reading


def law_fields(
    file: Reading, scenario: Scenario | None, uncertain: Mapping[str, Any], has_loop: bool
) -> dict[str, Any]:
    """Return the task fields that describe the control law.

    The result is empty for a virtual damper or a faulty file.
    """
    values = file.values("law")
    if file.law is None or file.law == DAMPER or values is None:
        return {}
    if file.law != DRAG:
        law = file.make("law")
        return {} if law is None else {"law": law, "gain": values.get(law.number.key)}
    if not has_loop:
        for name in SAMPLED_DRAG:
            if name in file.data["law"] and name != "drag":
                file.refuse(("law", name), "found a key of the sampled drag, expected [chain] and [controller] as well")
    effects = {name: values[name] for name in EFFECTS if name in values}
    if not effects:
        return {"law": DRAG, "gain": values.get("drag")}
    if set(effects) & set(AT_A_SPEED) and "largest_speed" not in values and scenario is not None:
        certain = not any(name.endswith(".velocity") for name in uncertain)
        if not (certain and scenario.relative_velocity < 0):
            why = "the obstacle does not approach" if certain else "the approach speed is uncertain"
            file.refuse(
                ("law", "largest_speed"),
                f"the largest approach speed is missing. The scenario does not determine this speed, because {why}; "
                'add, for example: largest_speed = "0.5 m/s"',
            )
    speed = values.get("largest_speed")
    return {"law": DRAG, "drag_effect": file.attempt("law", lambda: DragEffect(**effects, largest_speed=speed))}


def sampled_law(file: Reading) -> Law | None:
    """Return the sampled form of the control law.

    Its gain is 0 if the scenario file gives no gain.
    """
    values, law = file.values("law"), file.make("law")
    if values is None or law is None:
        return None
    sampled = getattr(law, "sampled", None)
    if not callable(sampled):
        file.refuse(
            ("law", "kind"),
            f'the law "{law.kind}" cannot run on the sampled loop, because it has no method "sampled". Add '
            "this method to the law, or remove the sections [chain] and [controller]",
        )
        return None
    return file.attempt("law", lambda: sampled(values.get(law.number.key, 0.0)))


def sampled_drag(file: Reading, chain: SensorChain) -> VirtualDrag | None:
    """Return the sampled virtual drag of a scenario file.

    Its noise is that of the sensor, unless the section [law] sets the noise.
    """
    values = file.values("law")
    if values is None:
        return None
    if chain.measures_distance and chain.distance_noise > 0 and "noise" not in values:
        file.refuse(
            ("law", "noise"),
            "missing, expected a sensor output, because [chain] has a noise of distances, not of readings",
        )
        return None
    parameters = {name: getattr(chain, name) for name in FROM_CHAIN}
    parameters |= {key: value for key, value in values.items() if key in SAMPLED_DRAG}
    return file.attempt("law", lambda: VirtualDrag(**{"drag": 0.0, **parameters}))
