"""Every equation of the letter that the source cites is one that the letter has."""

from __future__ import annotations

import re
from pathlib import Path

import pretouch
from pretouch._core.equations import EQUATIONS

SOURCE = Path(pretouch.__file__).parent
CITATION = re.compile(r"\bL\((\d+)\)(?:\s*[-–]\s*(?:L?\((\d+)\)|(\d+)))?")


def _cited(text: str) -> list[int]:
    """The numbers cited in a text, with all that a range such as L(16)-(19) covers."""
    cited = []
    for first, last, bare in CITATION.findall(text):
        low, high = int(first), int(last or bare or first)
        assert low <= high, f"L({low})-({high}) runs backward"
        cited += range(low, high + 1)
    return cited


def test_the_letter_has_equations_1_to_23() -> None:
    assert list(EQUATIONS) == [f"L({n})" for n in range(1, 24)]
    assert all(text.strip() for text in EQUATIONS.values())


def test_a_citation_is_read_with_its_range() -> None:
    assert _cited("by L(3), L(16)-(19) and L(5)-L(6), not ln(2) or XL(9)") == [3, 16, 17, 18, 19, 5, 6]


def test_every_cited_equation_exists() -> None:
    unknown, count = [], 0
    for path in sorted(SOURCE.rglob("*.py")):
        for n in _cited(path.read_text(encoding="utf-8")):
            count += 1
            if f"L({n})" not in EQUATIONS:
                unknown.append(f"{path.relative_to(SOURCE)}: L({n})")
    assert not unknown
    assert count > len(EQUATIONS)  # else the pattern has stopped finding them
