"""Verify a gain, and prepare the control law for an export."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.values import Value
from pretouch.control import Controller, VirtualDamper, VirtualDrag
from pretouch.designs import Task
from pretouch.designs.task import with_file_location
from pretouch.simulation import ClosedLoop
from pretouch.verification import Verdict
from pretouch.verification import verify as verdict_on
from pretouch.verification.effect import chase_in_words
from pretouch.verification.verdict import chosen_gain

from .vectors import Case, make_cases

WEAKER_NUMBER: Final = "A weaker {name} makes contact harder, and the verification does not cover it."
"""Warning for files that let their user weaken the gain or drag."""

SIGNS: Final = (
    "x is the axis of the sensor, positive toward the object. All positions, velocities, accelerations and forces "
    "count along x.",
    "`contact_force` is the force of the object on the robot. It is negative while an object in front of the sensor "
    "presses against the robot. A force sensor that reports the force of the robot on the object has the other sign: "
    "with it, the robot would press against the object.",
    "`reading` is the raw output with the polarity of the calibration. Do not subtract the offset; the law does it.",
    "A law that retreats commands a negative `virtual_force`, `velocity` and `position` when an object approaches.",
    "In the case `pressed` of `vectors.csv`, an object presses against the robot, and the reference retreats. A "
    "program around the law that reverses the sign of `contact_force` or of the commanded position fails this case, "
    "unless the design ignores contact forces (`contact_gain` is 0).",
)
"""The sign conventions of all exported laws, sentence by sentence."""

UNKNOWN: Final = (
    "the contact speed on the sampled loop, the limits, the stability of the loop, and how noise and failing readings "
    "move the robot"
)
"""What nobody knows about a law without a verification."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LawDesign(Value):
    """Controller, test vectors and verification verdict for an export.

    Args:
        task: the task, with its loop and sensor curve.
        controller: the controller, whose law has the exported gain or drag.
        law_text: the law and its number in words, such as "virtual damper, gain D_p = -0.7463 N s".
        cases: test vectors.
        origin: name of the scenario file, or "a Task in Python".
        digest: SHA-256 of the scenario file; None without a file.
        date: date of the verification as text; None if unknown.
        verdict: the verdict; None if the gain was not verified.
    """

    task: Task
    controller: Controller
    law_text: str
    cases: tuple[Case, ...]
    origin: str
    digest: str | None
    date: str | None
    verdict: Verdict | None

    @property
    def is_supported(self) -> bool:
        """True if the verification confirmed the gain, even if only narrowly."""
        return self.verdict is not None and self.verdict.status.is_passed

    @property
    def is_drag(self) -> bool:
        """True if the control law is a virtual drag.

        Otherwise, the law is a virtual damper.
        """
        return isinstance(self.controller.law, VirtualDrag)

    @property
    def number(self) -> str:
        """Name of the law's parameter in exported files.

        The name is "gain" for the virtual damper and "drag" for the virtual drag.
        """
        return "drag" if self.is_drag else "gain"

    @property
    def identifier(self) -> str:
        """Name of the scenario file with only characters that C names allow; "law" without a file."""
        stem = "law" if self.digest is None else Path(self.origin).stem
        return re.sub(r"\W", "_", stem, flags=re.ASCII)

    @property
    def suffix(self) -> str:
        """Suffix of the C names of this control law.

        The suffix is "_drag" for the virtual drag, and empty for the virtual damper.
        """
        return "_drag" if self.is_drag else ""

    @property
    def attraction(self) -> tuple[str, ...]:
        """Sentences on a law that pulls the robot toward the object.

        They are empty for a mitigating law.
        """
        return tuple(chase_in_words(self.task.law.number, self.controller.law.value))

    @property
    def verdict_text(self) -> str:
        """Sentence on the result and date of the verification.

        Without a verification, the sentence says so.
        """
        if self.verdict is None:
            toward = "".join(f" {text}." for text in self.attraction)
            return (
                f"Not verified: this law was exported without a verification.{toward} Unknown are {UNKNOWN}. Do not "
                "run this law on a robot before pretouch verify confirms it."
            )
        when = f" ({self.date})" if self.date else ""
        return f"pretouch verify{when}: {self.verdict.headline}"


@with_file_location
def law_design(task: Task, *, verify: bool = True, toward_object: bool = False, date: str | None = None) -> LawDesign:
    """Verify the gain of a task, and prepare its export.

    Args:
        task: the encounter with its sampled loop; the gain as for `verify`.
        verify: whether to verify the gain by simulation.
        toward_object: whether an unverified law may pull the robot toward the object.
        date: date that the exported files state for the verification.

    Returns:
        The design.

    Raises:
        InvalidInputError: the loop has no controller with a law in C, there is no gain, or an unverified gain has the
            wrong sign.
    """
    loop = task.loop
    if not isinstance(loop, ClosedLoop) or not isinstance(loop.law, Controller):
        raise InvalidInputError(
            "loop: an export needs the controller of a sampled loop, but this task has none; add [chain] and "
            "[controller] to the scenario file"
        )
    if type(loop.law.law) not in {VirtualDamper, VirtualDrag}:
        raise InvalidInputError(
            f"law: found {type(loop.law.law).__name__}, expected the virtual damper or the virtual drag; pretouch "
            "exports only these two laws. For a custom law, write the C code yourself (docs/how-to/own-law.md). Insert "
            "this code between the calls of the functions pretouch_observe and pretouch_drive"
        )
    verdict = verdict_on(task, changes=False) if verify else None
    gain = chosen_gain(task) if verdict is None else verdict.gain
    if gain is None:
        name = task.law.number.name
        reasons = "" if verdict is None else f". Reasons: {'; '.join(verdict.reasons)}"
        raise InvalidInputError(
            f"{name}: the design found no {name}, so there is nothing to export; change the limits or the bounds of "
            f"the design, or set the {name} with the option --gain{reasons}"
        )
    for text in () if verify or toward_object else chase_in_words(task.law.number, gain):
        raise InvalidInputError(
            f"{task.law.number.name}: {text}. Nothing was exported. Change the sign, or export such a law with the "
            "option --toward-object (toward_object=True in Python)",
            remedy="--toward-object",
        )
    controller: Any = loop.robot_law.with_value(gain)
    source: Any = task.source
    return LawDesign(
        task=task,
        controller=controller,
        law_text=f"{task.law.kind.replace('-', ' ')}, {task.law.number.name} {task.law.number.equals(gain)}",
        cases=make_cases(loop, controller, (task.scenario, task.sensor)),
        origin="a Task in Python" if source is None else source.path.name,
        digest=None if source is None else source.sha256,
        date=date,
        verdict=verdict,
    )
