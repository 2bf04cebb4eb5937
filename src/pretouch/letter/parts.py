"""List the tables, figures and sections of the published letter, and recompute them."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, Protocol

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError

from . import (
    attraction,
    constraints,
    figure_3,
    figure_4,
    figure_5,
    figure_6,
    impact_force,
    one_gain,
    table_1,
    table_2,
    table_3,
)
from .experiment import LetterReport, Reproduction, Variables
from .program import Program


class _Experiment(Protocol):
    """A module of this package that recomputes one part of the letter."""

    PROGRAM: Program

    def reproduce(self, variables: Variables) -> Reproduction:
        """Compare the variables of the program with the letter."""


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the letter, with the module that recomputes it.

    Args:
        place: place in the letter.
        title: title of the reproduction.
        experiment: the module.
    """

    place: str
    title: str
    experiment: _Experiment

    def recompute(self, name: str) -> Reproduction:
        """Run the program of this part, and compare its numbers with the letter."""
        program = self.experiment.PROGRAM
        variables = program.run()
        return replace(
            self.experiment.reproduce(variables),
            id=name,
            place=self.place,
            title=self.title,
            code=program.text,
            figure=variables["figure"],
        )


PARTS: Final = {
    "table-1": Part("Table I", "The sensor curves", table_1),
    "figure-3": Part("Fig. 3", "Sensor output over the distance", figure_3),
    "figure-4": Part("Section IV-D, Fig. 4", "Plant position until contact", figure_4),
    "figure-5": Part("Section IV-D, Fig. 5", "Relative velocity until contact", figure_5),
    "table-2": Part("Table II, Section V-A", "Gains for an approaching obstacle", table_2),
    "figure-6": Part("Fig. 6, Section V-A", "Optimal gain over the obstacle's speed", figure_6),
    "one-gain": Part("Section VI-C, Fig. 6", "One gain for all speeds", one_gain),
    "table-3": Part("Table III, Sections V-B and V-C", "Gains for tracking motion that is disrupted", table_3),
    "attraction": Part("Section VI-A", "Attraction of the uniform motion", attraction),
    "constraints": Part("Section VI-B", "Limits on motion and velocity", constraints),
    "impact-force": Part("Section VI-B", "The force of the impact instead of its speed", impact_force),
}
"""The parts that can be recomputed, by their names on the command line, in the order of the letter."""

IDS: Final = tuple(PARTS)


@check_arguments
def reproduce(ids: Sequence[str] = (), *, progress: Callable[[str], None] | None = None) -> LetterReport:
    """Recompute the published letter and compare the numbers.

    Tables, figures and sections can be recomputed.

    Args:
        ids: names of reproductions, from IDS; all by default.
        progress: called with each id before its computation.

    Returns:
        The reproductions, in the order of the letter.

    Raises:
        InvalidInputError: an id is unknown.

    Examples:
        >>> report = reproduce(["figure-3"])
        >>> report.holds
        True
    """
    unknown = [name for name in ids if name not in IDS]
    if unknown:
        near = difflib.get_close_matches(unknown[0].lower().replace("_", "-"), IDS, n=1)
        hint = f". Did you mean {near[0]}?" if near else ""
        raise InvalidInputError(
            f"reproduce: the published letter has no part named {unknown[0]!r}. The available parts are: "
            f"{', '.join(IDS)}{hint}",
            value=unknown[0],
            limit=tuple(IDS),
            remedy=near[0] if near else "",
        )
    reproductions = []
    for name in IDS:
        if not ids or name in ids:
            if progress is not None:
                progress(name)
            reproductions.append(PARTS[name].recompute(name))
    return LetterReport(reproductions=tuple(reproductions))
