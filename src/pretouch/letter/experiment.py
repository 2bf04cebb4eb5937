"""Define the results of comparing the published letter with recomputed values."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from pretouch._core.blocks import PageSection, PageTable
from pretouch._core.display import Described
from pretouch._core.values import Value

from .printed import Agreement, Parameter, Printed, short_exponent

Variables: TypeAlias = Mapping[str, Any]
"""The variables of a program after it was run."""


@dataclass(frozen=True, slots=True)
class Step(Value):
    """One step in the derivation of a finding about the published letter.

    Args:
        name: what is computed or tested.
        value: a number, a text, or whether a condition holds.
        unit: the unit of a number; empty for a pure number.

    Examples:
        >>> str(Step("x at contact", -0.0915344, "m"))
        '-0.0915344 m'
        >>> str(Step("f1 follows from it", False))
        'does NOT hold'
    """

    name: str
    value: float | str | bool
    unit: str = ""

    def __post_init__(self) -> None:
        if hasattr(self.value, "item"):  # a scalar of NumPy
            object.__setattr__(self, "value", self.value.item())

    def __str__(self) -> str:
        """Return the value of this step as text.

        A number has six digits. A condition is written as `holds` or `does NOT hold`.
        """
        if isinstance(self.value, bool):
            return "holds" if self.value else "does NOT hold"
        shown = self.value if isinstance(self.value, str) else short_exponent(f"{self.value:.6g}")
        return f"{shown} {self.unit.replace('*', ' ')}".strip()


@dataclass(frozen=True, slots=True)
class Finding(Value):
    """Statement about the published letter with its derivation.

    For example, a statement names an error in the text of the letter.

    Args:
        id: the number of the finding: 1 to 7 were known before; this program found those from 8 on.
        title: the finding in one sentence.
        place: place in the letter.
        statement: the finding with its reason.
        evidence: the computed steps of the derivation, and the conditions that must hold.
    """

    id: int
    title: str
    place: str
    statement: str
    evidence: tuple[Step, ...]

    @property
    def failed(self) -> tuple[Step, ...]:
        """The required conditions of this finding that are not met."""
        return tuple(step for step in self.evidence if step.value is False)

    @property
    def holds(self) -> bool:
        """Whether all conditions that this finding requires are met."""
        return not self.failed

    def to_dict(self) -> dict[str, Any]:
        """Return the finding about the letter as a dictionary.

        All values are plain.
        """
        return _fields(self, "id", "title", "place", "statement", "holds", "evidence")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Reproduction(Value):
    """Part of the published letter compared with recomputed values.

    The part is a table, a figure or a section.

    Args:
        summary: method and result in a few sentences.
        parameters: the inputs.
        comparisons: printed numbers compared with computed ones.
        findings: findings that are more than single numbers.
        tables: tables of numbers that the letter does not print.
        caption: caption of the figure.
        numbers: all numbers in SI, for other programs: a mapping of names to numbers, texts, lists or mappings.
        id: name on the command line, such as "table-2".
        place: place in the letter.
        title: title of the reproduction.
        code: the program that makes the figure.
        figure: the Matplotlib figure of this program.
    """

    summary: str
    parameters: tuple[Parameter, ...]
    comparisons: tuple[Printed, ...] = ()
    findings: tuple[Finding, ...] = ()
    tables: tuple[PageSection, ...] = ()
    caption: str
    numbers: Mapping[str, Any]
    id: str = ""
    place: str = ""
    title: str = ""
    code: str = ""
    figure: Any = field(default=None, compare=False)

    @property
    def holds(self) -> bool:
        """Whether all differences from the letter are explained.

        All findings must also be confirmed.
        """
        return all(f.holds for f in self.findings) and not any(c.unexplained for c in self.comparisons)

    @property
    def counts(self) -> Counter[Agreement]:
        """The number of published values for each degree of agreement."""
        return Counter(c.agreement for c in self.comparisons)

    def __repr__(self) -> str:
        state = "holds" if self.holds else "DOES NOT HOLD"
        return f"<Reproduction {self.id}: {len(self.comparisons)} numbers, {len(self.findings)} findings, {state}>"

    def to_dict(self) -> dict[str, Any]:
        """Return the recomputed values as a dictionary.

        All values are plain. The plot is omitted.
        """
        parameters = [_fields(p, "name", "symbol", "value", "unit", "place") for p in self.parameters]
        names = ("title", "place", "holds", "comparisons", "findings", "numbers")
        return _fields(self, *names) | {"parameters": parameters}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LetterReport(Described, Value):
    """Comparison of the published letter with recomputed values.

    This is the result of `reproduce`.

    Args:
        reproductions: one for each requested table, figure and section, in the order of the letter.
    """

    reproductions: tuple[Reproduction, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether pretouch agrees with the published letter.

        A difference with an explanation counts as agreement.
        """
        return all(r.holds for r in self.reproductions)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings about the published letter, sorted by number."""
        return tuple(sorted((f for r in self.reproductions for f in r.findings), key=lambda f: f.id))

    @property
    def counts(self) -> dict[Agreement, int]:
        """The number of published values for each degree of agreement.

        All tables, figures and sections are counted.
        """
        return {a: sum(r.counts[a] for r in self.reproductions) for a in Agreement}

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison with the letter as a dictionary.

        It contains every number as a plain value.
        """
        return {
            "holds": self.holds,
            "counts": {agreement.value: count for agreement, count in self.counts.items()},
            "findings": self.findings,
            "reproductions": {r.id: r for r in self.reproductions},
        }

    def __repr__(self) -> str:
        names = ", ".join(r.id for r in self.reproductions)
        return f"<LetterReport {names}: {'holds' if self.holds else 'DOES NOT HOLD'}>"


def finding(number: int, title: str, place: str, statement: str, *steps: tuple[Any, ...]) -> Finding:
    """Create a finding about the published letter. Each derivation step has a name, a value and a unit."""
    return Finding(number, title, place, statement, tuple(Step(*step) for step in steps))


def readings(title: str, columns: Mapping[str, tuple[Iterable[Any], str]], note: str = "") -> PageSection:
    """Create a table of numbers for the report on the published letter."""
    cells = ([format(value, form) for value in values] for values, form in columns.values())
    return PageSection(
        title=title, blocks=(PageTable(head=tuple(columns), rows=tuple(zip(*cells, strict=True)), note=note),)
    )


def _fields(thing: object, *names: str) -> dict[str, Any]:
    return {name: getattr(thing, name) for name in names}
