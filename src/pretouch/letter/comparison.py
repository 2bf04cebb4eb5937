"""A printed number beside ours: its inputs, its verdict, and what rounding has to do with it."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from enum import Enum

from pretouch._core.errors import InvalidInputError
from pretouch._core.values import Value

__all__ = ["Comparison", "Parameter", "Verdict", "compare", "measured", "resolution"]


class Verdict(Enum):
    """How a printed number stands to ours. The value is the word for it in files and JSON."""

    AGREES = "agrees"
    WITHIN_INPUTS = "agrees-within-inputs"
    DISAGREES = "disagrees"
    MEASURED = "measured"

    @property
    def meaning(self) -> str:
        """What the verdict says, for a person."""
        return _MEANINGS[self.value]


_MEANINGS = {
    "agrees": "agrees to the printed digits",
    "agrees-within-inputs": "agrees within the rounding of the printed inputs",
    "disagrees": "disagrees",
    "measured": "measured on hardware: compared, not matched",
}


def resolution(printed: str) -> float:
    """Return one unit in the last printed place.

    Args:
        printed: a number as it stands in the letter.

    Returns:
        The unit: 0.001 for "-0.082".

    Raises:
        InvalidInputError: the text is not a number.

    Examples:
        >>> resolution("-0.082"), resolution("1.30e-5"), resolution("474")
        (0.001, 1e-07, 1.0)
    """
    try:
        exponent = Decimal(printed).as_tuple().exponent
    except ArithmeticError:
        raise InvalidInputError(f"printed: found {printed!r}, expected a number") from None
    return float(Decimal(1).scaleb(int(exponent)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter(Value):
    """One input of an experiment, as the letter gives it.

    Args:
        name: what it is.
        symbol: how the letter writes it.
        printed: its value as printed.
        unit: its unit; empty for a pure number.
        place: where in the letter it stands.
    """

    name: str
    symbol: str
    printed: str
    unit: str
    place: str

    @property
    def value(self) -> float:
        """The value in the printed unit."""
        return float(self.printed)


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison(Value):
    """One printed number beside ours.

    Args:
        name: which number.
        printed: as it stands in the letter.
        value: ours.
        unit: the unit of both; empty for a pure number.
        place: where in the letter it stands.
        verdict: how the two stand to each other.
        reason: why they differ; empty where they agree or nothing explains it.
        low: the smallest value of ours over the rounding of the printed inputs; None where not asked for.
        high: the largest.
    """

    name: str
    printed: str
    value: float
    unit: str
    place: str
    verdict: Verdict
    reason: str = ""
    low: float | None = None
    high: float | None = None

    @property
    def printed_value(self) -> float:
        """The printed number."""
        return float(self.printed)

    @property
    def difference(self) -> float:
        """Ours minus the printed number, in its unit."""
        return self.value - self.printed_value

    @property
    def unexplained(self) -> bool:
        """Whether the numbers disagree and nothing says why."""
        return self.verdict is Verdict.DISAGREES and not self.reason


def compare(
    name: str,
    printed: str,
    value: float,
    *,
    unit: str,
    place: str,
    reason: str = "",
    over_inputs: tuple[float, float] | None = None,
) -> Comparison:
    """Compare a printed number that follows from the equations with ours.

    Args:
        name: which number.
        printed: as it stands in the letter.
        value: ours.
        unit: the unit of both.
        place: where in the letter it stands.
        reason: why they differ, where that is known; it is kept only where they do.
        over_inputs: smallest and largest of ours over the rounding of the printed inputs.

    Returns:
        The comparison: it agrees where ours rounds to the printed digits, or does so for inputs that round to theirs.

    Examples:
        >>> compare("l' at contact", "-0.088", -0.08766, unit="m/s", place="Table II").verdict.meaning
        'agrees to the printed digits'
    """
    half = resolution(printed) / 2 * (1 + 1e-9)
    target = float(printed)
    low, high = over_inputs if over_inputs is not None else (value, value)
    if abs(value - target) <= half:
        verdict = Verdict.AGREES
    elif low - half <= target <= high + half:
        verdict = Verdict.WITHIN_INPUTS
    else:
        verdict = Verdict.DISAGREES
    return Comparison(
        name=name,
        printed=printed,
        value=value,
        unit=unit,
        place=place,
        verdict=verdict,
        reason=reason if verdict is Verdict.DISAGREES else "",
        low=None if over_inputs is None else low,
        high=None if over_inputs is None else high,
    )


def measured(name: str, printed: str, value: float, *, unit: str, place: str, reason: str = "") -> Comparison:
    """Compare a number that was measured on hardware with ours; nothing says that they must agree.

    Args:
        name: which number.
        printed: as it stands in the letter.
        value: ours.
        unit: the unit of both.
        place: where in the letter it stands.
        reason: what makes them differ.

    Returns:
        The comparison.
    """
    return Comparison(
        name=name, printed=printed, value=value, unit=unit, place=place, verdict=Verdict.MEASURED, reason=reason
    )
