"""What a user should read before relying on a gain."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from pretouch._core.units import format_quantity
from pretouch.motion import ContactResult, ContactStatus
from pretouch.motion.evaluator import NoisyEvaluator

if TYPE_CHECKING:
    from .result import GainDesign

__all__ = ["design_warnings"]

_RESIDUAL = 1e-9


def design_warnings(design: GainDesign, scanned: ContactResult) -> Iterator[str]:
    """Yield what should be read before relying on a design, in order of weight.

    Args:
        design: the design.
        scanned: the encounters of its scan.

    Yields:
        Sentences.
    """
    yield from _about_contact(design, scanned)
    if design.certificate is not None and design.certificate.at == "bound":
        yield (
            f"the optimum lies on the bound {format_quantity(design.gain or 0.0, 'N*s')}: a wider range of gains may "
            "hold a better one"
        )
    if design.certificate is not None and design.certificate.at == "edge of contact":
        yield "the optimum lies where contact is just still made: a slightly larger gain misses the object"
    if design.method == "uniform-motion":
        yield (
            "the uniform motion L(16)-(19) is one particular motion that does not start from the given state; it "
            "shifts the optimal gain by about 10 %: compare with method 'integration'"
        )
    if _is_luck(design):
        yield (
            "the gain is optimal for one run and its noise: another run has another optimum; design_robust_gain with "
            "the same evaluate averages over runs"
        )
    if design.gain is not None and design.gain > 0:
        yield "the optimal gain is positive: it drives the plant toward the object"
    if design.result is not None:
        residual = float(np.asarray(design.result.impulse_residual))
        if residual > _RESIDUAL:
            yield f"the impulse balance of the motion is met to {residual:.0e} only: its numbers are less certain"


def _is_luck(design: GainDesign) -> bool:
    """Tell whether the encounter at the optimum comes out otherwise with the noise of another run."""
    evaluator = design.evidence.problem.evaluator
    if design.result is None or not isinstance(evaluator, NoisyEvaluator):
        return False
    again = evaluator.after(1)(design.scenario, design.sensor, design.gain)
    return bool(again.end.time != design.result.end.time)


def _about_contact(design: GainDesign, scanned: ContactResult) -> Iterator[str]:
    """Yield what became of the gains without contact."""
    status = np.asarray(scanned.status)
    for kind in ContactStatus:
        count = int((status == kind).sum())
        if kind is ContactStatus.CONTACT or not count:
            continue
        share = "every gain" if count == status.size else f"{count} of {status.size} scanned gains"
        text = f"{share} ended without contact ({kind.label}): {kind.meaning[0].lower()}{kind.meaning[1:]}"
        distances = np.asarray(scanned.closest_distance)[status == kind]
        text += f" Nearest approach {format_quantity(float(distances.min()), 'm')}."
        low = design.sensor.valid_range[0]
        if kind is ContactStatus.LEFT_RANGE and low > 0:
            text += (
                f" The curve starts at {format_quantity(low, 'm')}: mount the sensor that far behind the contact "
                "surface and give this as its recess."
            )
        yield text
    if design.gain is not None and not design.no_mitigation.reached.all():
        yield "without mitigation the encounter would not end in contact at all"
