"""`pretouch design`: the optimal gain of a scenario file."""

from __future__ import annotations

from .options import ScenarioFile
from .terminal import Presentation, load, verb

__all__ = ["design"]


@verb
def design(shown: Presentation, *, file: ScenarioFile) -> None:
    """Choose the gain for a scenario file (TOML), and the admittance where the file leaves it open.

    Prints the optimal gain, the contact it leads to, every constraint with its margin, what no mitigation would have
    given, and what the gain is most sensitive to; writes a report with figures, STEM-design.html in this folder.

    Exit status: 0 optimal, 1 no gain meets the constraints or ends in contact, 2 a mistake in the request.
    """
    from pretouch.design import design_admittance, design_gain  # noqa: PLC0415 - `pretouch --help` stays quick

    task = load(file, "searching gains")
    found = design_admittance(task) if task.is_admittance_free else design_gain(task)
    shown.show(found, f"{file.stem}-design.html", task, good=found.status == "optimal")
