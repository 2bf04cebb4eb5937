"""What the pages of the site show is what happens: their sessions print that, and their Python runs."""

from __future__ import annotations

import doctest
import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from sessions import DOCS, ROOT, agrees, pages_with_sessions, run_page

FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
PAGES = (
    *("start.md", "tutorial.md", "explanation/method.md", "explanation/offset.md", "explanation/stability.md"),
    *("explanation/bounds.md", "explanation/surprises.md", "explanation/signs-and-units.md", "explanation/motion.md"),
    *(f"how-to/{name}.md" for name in ("bounces", "crashes-while-tuning", "force-limit", "slow-sensor")),
    *(
        f"how-to/{name}.md"
        for name in (
            "light-and-surfaces",
            "two-fingers",
            "which-part",
            "after-a-month",
            "gain-table",
            "moving-average",
            "readings",
        )
    ),
    *(
        f"how-to/{name}.md"
        for name in ("ros2-control-admittance", "leg-landing", "notebook", "cluster", "teensy", "export/arduino")
    ),
)
NEGATIVE = ("Does not hold", "Infeasible", "4 detections in 16 s", "Not decided")  # answers that end with exit status 1
ELSEWHERE = {  # pages whose Python another test runs
    *("explanation/design.md", "explanation/gradients.md", "explanation/verification.md", "how-to/robust.md"),
    *(
        "explanation/features.md",
        "explanation/simulation.md",
        "explanation/control.md",
        "explanation/drag.md",
        "how-to/own-law.md",
    ),
    *("how-to/extending.md", "how-to/trade-offs.md", "how-to/sweeps.md", "how-to/what-did-my-sensor-see.md"),
    *(
        "how-to/export.md",
        "how-to/export/c.md",
        "how-to/record-a-calibration.md",
        "how-to/robots.md",
        "explanation/letter.md",
    ),
    *("explanation/calibration.md", "how-to/good-calibration.md", "how-to/export/fmu.md", "how-to/export/ros2.md"),
}


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize("page", pages_with_sessions(), ids=lambda page: page.stem)
def test_the_sessions_of_a_page_print_what_it_shows(page: Path, tmp_path: Path) -> None:
    """One after the other in one folder, because later commands read the files of earlier ones."""
    text = page.read_text(encoding="utf-8")
    if re.search(r"^\$ pretouch (project|robot) ", text, re.MULTILINE):
        pytest.importorskip("mujoco", reason="needs the extra mujoco")
    if "pretouch export fmu" in text and not shutil.which("cc"):
        pytest.skip("no compiler")
    for step, status, printed in run_page(page, tmp_path):
        assert agrees(step.shown, printed), f"$ {step.command}\n{printed}\nIf that is intended: make words"
        assert status == int(step.shown.startswith(NEGATIVE)), step.command


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "python")])
def test_the_python_of_a_page_runs(page: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    parser, runner = doctest.DocTestParser(), doctest.DocTestRunner(optionflags=FLAGS)
    names: dict[str, Any] = {}
    test = parser.get_doctest("\n".join(blocks(page, "python")), names, page, page, 0)
    if not test.examples:  # a program without prompts
        exec(compile(test.docstring or "", page, "exec"), names)  # noqa: S102 - our own page
    runner.run(test)
    assert runner.summarize().failed == 0


def test_every_page_with_python_or_a_session_is_run_somewhere() -> None:
    """A new page is added to PAGES here; the older ones have tests of their own."""
    pages = [p.relative_to(DOCS).as_posix() for p in DOCS.rglob("*.md")]
    examples = {page for page in pages if blocks(page, "python") or blocks(page, "console")}
    internal = {page for page in examples if page.startswith(("developers/", "decisions/", "reference/"))}
    assert examples - internal - set(PAGES) <= ELSEWHERE


QUESTIONS = (
    *(
        "bounces",
        "crashes-while-tuning",
        "force-limit",
        "light-and-surfaces",
        "slow-sensor",
        "two-fingers",
        "which-part",
        "ros2-control-admittance",
    ),
    *("leg-landing", "export", "notebook", "cluster"),
)


def links(page: Path) -> set[Path]:
    text = page.read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([^)#\s]+\.md)(?:#[^)]*)?\)", text)
    return {(page.parent / target).resolve() for target in targets if not target.startswith("http")}


@pytest.mark.parametrize("start", ["README.md", "docs/index.md"])
def test_every_question_is_answered_within_two_clicks(start: str) -> None:
    first = links(ROOT / start)
    second = first.union(*(links(page) for page in first if page.exists()))
    wanted = {(DOCS / f"how-to/{name}.md").resolve() for name in QUESTIONS} | {(DOCS / "warnings/README.md").resolve()}
    assert wanted <= second
