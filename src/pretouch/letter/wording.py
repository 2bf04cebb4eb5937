"""How a comparison and a step of evidence are written: verdicts in words and shapes, numbers as they are printed."""

from __future__ import annotations

import math
import re
from typing import Any, Final

from .comparison import Comparison, Verdict
from .result import Evidence

__all__ = ["SHAPES", "WORDS", "difference", "evidence", "failed", "numeral", "ours", "over_inputs"]

WORDS: Final[dict[Verdict, str]] = {
    Verdict.AGREES: "agrees",
    Verdict.WITHIN_INPUTS: "agrees within inputs",
    Verdict.DISAGREES: "disagrees",
    Verdict.MEASURED: "measured",
}
"""A verdict in a word or two."""

SHAPES: Final[dict[Verdict, str]] = {
    Verdict.AGREES: "\u25cf",
    Verdict.WITHIN_INPUTS: "\u25cb",
    Verdict.DISAGREES: "\u25b2",
    Verdict.MEASURED: "\u25a1",
}
"""A verdict as a shape, which does without color."""

_MORE = 2  # digits beyond the printed ones: enough to see how ours rounds
_LONGEST = 14


def numeral(value: float, printed: str, sign: str = "") -> str:
    """Write a number with two decimals more than a printed one, in its notation.

    Args:
        value: the number.
        printed: the number that sets the notation.
        sign: "+" to write a plus sign, too.

    Returns:
        The number; one that is far longer than the printed one has six digits, one that is none says so.

    Examples:
        >>> numeral(-0.091534, "-0.082"), numeral(1.2987e-5, "1.30e-5"), numeral(0.00034, "-0.088", "+")
        ('-0.09153', '1.2987e-5', '+0.00034')
    """
    if not math.isfinite(value):
        return "not a number" if math.isnan(value) else "infinite" if value > 0 else "-infinite"
    mantissa, exponential, _ = printed.lower().partition("e")
    places = len(mantissa.partition(".")[2]) + _MORE
    text = f"{value:{sign}.{places}{'e' if exponential else 'f'}}"
    if len(text) > _LONGEST + len(printed):
        text = f"{value:{sign}.6g}"
    if float(text) == 0:
        text = text.lstrip("+-")
    return _short_exponent(text)


def ours(comparison: Comparison) -> str:
    """Write our number, two decimals more precisely than the printed one."""
    return numeral(comparison.value, comparison.printed)


def difference(comparison: Comparison) -> str:
    """Write ours minus the printed number, with its sign."""
    if "e" in comparison.printed.lower() and math.isfinite(comparison.difference):
        return numeral(comparison.difference, "1e0" if comparison.difference else "0", "+")
    return numeral(comparison.difference, comparison.printed, "+")


def over_inputs(comparison: Comparison) -> str:
    """Write the range of ours over the rounding of the printed inputs; empty where it was not asked for."""
    if comparison.low is None or comparison.high is None:
        return ""
    return f"{numeral(comparison.low, comparison.printed)} to {numeral(comparison.high, comparison.printed)}"


def evidence(step: Evidence) -> str:
    """Write the value of a step with its unit.

    Args:
        step: one step of a derivation.

    Returns:
        Six digits of a number, a text as it is, and words for a condition.

    Examples:
        >>> evidence(Evidence(name="x at contact", value=-0.0915344, unit="m"))
        '-0.0915344 m'
        >>> evidence(Evidence(name="f1 follows from it", value=False))
        'does NOT hold'
    """
    value = _bare(step.value)
    if isinstance(value, bool):
        return "holds" if value else "does NOT hold"
    shown = value if isinstance(value, str) else _short_exponent(f"{value:.6g}")
    return f"{shown} {step.unit.replace('*', ' ')}".strip()


def failed(step: Evidence) -> bool:
    """Tell whether a step is a condition that does not hold."""
    return _bare(step.value) is False


def _short_exponent(text: str) -> str:
    """Write e-5 for e-05 and e5 for e+05."""
    return re.sub(r"e([+-]?)0*(\d)", lambda found: f"e{found[1].strip('+')}{found[2]}", text)


def _bare(value: Any) -> Any:
    """Take a scalar of NumPy for the number or truth value that it is."""
    return value.item() if hasattr(value, "item") else value
