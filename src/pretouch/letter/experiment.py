"""What a reproduction comes to: numbers beside ours, what was found, tables, a figure and its program."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass, replace
from importlib import import_module
from typing import Any, ClassVar, Final, TypeAlias

from pretouch._core.arguments import check_arguments
from pretouch._core.blocks import Chapter, Described, Rows
from pretouch._core.errors import InvalidInputError
from pretouch._core.values import Value

from .printed import Agreement, Parameter, Printed, short_exponent

EXPERIMENTS: Final = {
    "table-1": ("Table I", "The sensor curves"),
    "figure-3": ("Fig. 3", "Sensor output over the distance"),
    "figure-4": ("Section IV-D, Fig. 4", "Plant position until contact"),
    "figure-5": ("Section IV-D, Fig. 5", "Relative velocity until contact"),
    "table-2": ("Table II, Section V-A", "Gains for an approaching obstacle"),
    "figure-6": ("Fig. 6, Section V-A", "Optimal gain over the obstacle's speed"),
    "one-gain": ("Section VI-C, Fig. 6", "One gain for all speeds"),
    "table-3": ("Table III, Sections V-B and V-C", "Gains for tracking motion that is disrupted"),
    "attraction": ("Section VI-A", "Attraction of the uniform motion"),
    "constraints": ("Section VI-B", "Limits on motion and velocity"),
    "impact-force": ("Section VI-B", "The force of the impact in place of its speed"),
}
"""Place and title of what can be reproduced, in the order of the letter; each has a file of its own."""

IDS: Final = tuple(EXPERIMENTS)

Ran: TypeAlias = Mapping[str, Any]
"""The variables that a program leaves."""


@dataclass(frozen=True, slots=True)
class Program(Value):
    """A script of some ten to twenty lines of `import pretouch as pt`, which runs by itself.

    Args:
        about: what it shows, its docstring.
        given: inputs of the letter by the names that the program has for them; written into it as the calls that make
            them, an earlier one by its name where a later one holds it.
        body: the rest; it leaves a `figure`, and what the figure shows.
        imports: lines beside the imports of pretouch, and of NumPy, which is there where it is used.
    """

    about: str
    given: Mapping[str, Any]
    body: str
    imports: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The whole script."""
        lines = [f'"""{self.about}"""', ""]
        others = [*(["import numpy as np"] if "np." in self.body else []), *self.imports]
        lines += [*others, *([""] if others else []), "import pretouch as pt", ""]
        names: dict[str, Any] = {}
        for name, value in self.given.items():
            lines.append(f"{name} = {_as_code(value, names)}")
            names[name] = value
        return "\n".join([*lines, self.body])

    def run(self, name: str = "program") -> dict[str, Any]:
        """Run the script, and return the variables that it leaves."""
        variables: dict[str, Any] = {"__name__": name}
        exec(compile(self.text, name, "exec"), variables)  # noqa: S102 - our own text, shown beside what it makes
        return variables


@dataclass(frozen=True, slots=True)
class Step(Value):
    """One step of the derivation of a finding.

    Args:
        name: what was computed.
        value: a number, a text, or whether a condition holds.
        unit: the unit of a number; empty for a pure one.

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
        """Return six digits of a number, a text as it is, and words for a condition."""
        if isinstance(self.value, bool):
            return "holds" if self.value else "does NOT hold"
        shown = self.value if isinstance(self.value, str) else short_exponent(f"{self.value:.6g}")
        return f"{shown} {self.unit.replace('*', ' ')}".strip()


@dataclass(frozen=True, slots=True)
class Finding(Value):
    """What the program derived about the letter's text, beside single numbers.

    Args:
        id: the number of the point, 1 to 7 as they were first listed, and from 8 on what this program found itself.
        title: what is found, in a sentence.
        place: where in the letter.
        statement: the finding with its reason.
        evidence: the computed steps that it rests on, and the conditions that make it hold.
    """

    id: int
    title: str
    place: str
    statement: str
    evidence: tuple[Step, ...]

    @property
    def failed(self) -> tuple[Step, ...]:
        """The conditions that do not hold."""
        return tuple(step for step in self.evidence if step.value is False)

    @property
    def holds(self) -> bool:
        """Whether every condition does."""
        return not self.failed

    def to_dict(self) -> dict[str, Any]:
        """Return the finding in plain values."""
        return _fields(self, "id", "title", "place", "statement", "holds", "evidence")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Reproduction(Value):
    """One table, figure or section of the letter, computed again.

    Args:
        summary: what was done and what came out, in a few sentences.
        parameters: its inputs.
        comparisons: its numbers beside ours.
        findings: what was derived beyond single numbers.
        tables: numbers to read that the letter does not print, each under its title.
        caption: what the figure shows.
        numbers: every number, for other programs: text to numbers, text, lists and mappings of these, all SI.
        id: its name on the command line: "table-2".
        place: where in the letter it stands.
        title: what it shows.
        code: the program that makes the figure.
        figure: the figure that this program made, of Matplotlib.
    """

    summary: str
    parameters: tuple[Parameter, ...]
    comparisons: tuple[Printed, ...] = ()
    findings: tuple[Finding, ...] = ()
    tables: tuple[Chapter, ...] = ()
    caption: str
    numbers: Mapping[str, Any]
    id: str = ""
    place: str = ""
    title: str = ""
    code: str = ""
    figure: Any = field(default=None, compare=False)

    @property
    def holds(self) -> bool:
        """Whether every difference is explained and every finding came out."""
        return all(f.holds for f in self.findings) and not any(c.unexplained for c in self.comparisons)

    @property
    def counts(self) -> Counter[Agreement]:
        """How many printed numbers stand how to ours."""
        return Counter(c.agreement for c in self.comparisons)

    def __repr__(self) -> str:
        state = "holds" if self.holds else "DOES NOT HOLD"
        return f"<Reproduction {self.id}: {len(self.comparisons)} numbers, {len(self.findings)} findings, {state}>"

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the figure, in plain values."""
        given = [_fields(p, "name", "symbol", "value", "unit", "place") for p in self.parameters]
        names = ("title", "place", "holds", "comparisons", "findings", "numbers")
        return _fields(self, *names) | {"parameters": given}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LetterReport(Described, Value):
    """What `reproduce` returns.

    Args:
        reproductions: one for each table, figure and section asked for, in the order of the letter.
    """

    page: ClassVar[str] = "pretouch.letter.page:letter_page"

    reproductions: tuple[Reproduction, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether this installation gives what the letter's equations give: all differences explained."""
        return all(r.holds for r in self.reproductions)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings, in the order of their numbers."""
        return tuple(sorted((f for r in self.reproductions for f in r.findings), key=lambda f: f.id))

    @property
    def counts(self) -> dict[Agreement, int]:
        """How many printed numbers stand how to ours."""
        return {a: sum(r.counts[a] for r in self.reproductions) for a in Agreement}

    def to_dict(self) -> dict[str, Any]:
        """Return every number, in plain values."""
        return {
            "holds": self.holds,
            "counts": {agreement.value: count for agreement, count in self.counts.items()},
            "findings": self.findings,
            "reproductions": {r.id: r for r in self.reproductions},
        }

    def __repr__(self) -> str:
        names = ", ".join(r.id for r in self.reproductions)
        return f"<LetterReport {names}: {'holds' if self.holds else 'DOES NOT HOLD'}>"


@check_arguments
def reproduce(ids: Sequence[str] = (), *, progress: Callable[[str], None] | None = None) -> LetterReport:
    """Compute tables, figures and sections of the letter again, and compare each printed number with ours.

    Args:
        ids: which ones, of IDS; all where none is given.
        progress: called with each id as its work begins.

    Returns:
        The reproductions, in the order of the letter.

    Raises:
        InvalidInputError: an id is not known.

    Examples:
        >>> report = reproduce(["figure-3"])
        >>> report.holds
        True
    """
    unknown = [name for name in ids if name not in IDS]
    if unknown:
        near = difflib.get_close_matches(unknown[0].lower().replace("_", "-"), IDS, n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise InvalidInputError(f"reproduce: found {unknown[0]!r}, expected one or more of {', '.join(IDS)}{hint}")
    done = []
    for name in IDS:
        if not ids or name in ids:
            if progress is not None:
                progress(name)
            done.append(_reproduction(name))
    return LetterReport(reproductions=tuple(done))


def _reproduction(name: str) -> Reproduction:
    experiment = import_module(f"{__package__}.{name.replace('-', '_')}")  # loads only what it needs
    ran, (place, title) = experiment.PROGRAM.run(), EXPERIMENTS[name]
    found: Reproduction = experiment.reproduce(ran)
    return replace(found, id=name, place=place, title=title, code=experiment.PROGRAM.text, figure=ran["figure"])


def finding(number: int, title: str, place: str, statement: str, *steps: tuple[Any, ...]) -> Finding:
    """Make a finding; each step is its name, its value and the unit of a number."""
    return Finding(number, title, place, statement, tuple(Step(*step) for step in steps))


def readings(title: str, columns: Mapping[str, tuple[Iterable[Any], str]], note: str = "") -> Chapter:
    """Make a table of numbers to read, each column by its head, with its values and how they are written."""
    cells = ([format(value, form) for value in values] for values, form in columns.values())
    return Chapter(title=title, blocks=(Rows(head=tuple(columns), rows=tuple(zip(*cells, strict=True)), note=note),))


def _fields(thing: object, *names: str) -> dict[str, Any]:
    return {name: getattr(thing, name) for name in names}


def _as_code(value: Any, names: Mapping[str, Any]) -> str:
    """Write a value as the call that makes it: known values by their names, and nothing that is as by default."""
    for name, known in names.items():
        if value == known:
            return name
    if not is_dataclass(value):
        return repr(value)
    held = ((f.name, getattr(value, f.name), _default(f)) for f in fields(value) if f.init)
    given = ", ".join(f"{name}={_as_code(own, names)}" for name, own, default in held if own != default)
    return f"pt.{type(value).__name__}({given})"


def _default(of: Field[Any]) -> Any:
    return of.default if of.default_factory is MISSING else of.default_factory()
