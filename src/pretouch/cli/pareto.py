"""`pretouch pareto`: the trade-off of a scenario file."""

from __future__ import annotations

from .options import ScenarioFile
from .terminal import Presentation, load, verb

__all__ = ["pareto"]


@verb
def pareto(shown: Presentation, *, file: ScenarioFile) -> None:
    """Find what a scenario file (TOML) can trade: the Pareto front of contact quantities.

    Prints the knee of the front, its ends, where the designed gain or the choice of the file lies, and how far all of
    them are from what any controller could reach; writes a report with figures, STEM-pareto.html in this folder.

    Exit status: 0 a front was found, 1 no choice meets the constraints or ends in contact, 2 a mistake in the request.
    """
    from pretouch.design import pareto_front  # noqa: PLC0415 - `pretouch --help` stays quick

    task = load(file, "tracing what can be traded")
    found = pareto_front(task)
    shown.show(found, f"{file.stem}-pareto.html", task, good=found.status == "found")
