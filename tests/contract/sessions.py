"""Console sessions of pages and snapshots: run their commands, compare what they print, and rewrite it."""

from __future__ import annotations

import contextlib
import difflib
import doctest
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from command_text import as_in_a_terminal, in_this_process

import pretouch
from loop_text import LOOPED
from scenario_text import ADMITTANCE, SENSOR, STILL, WHOLE

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SNAPSHOTS = Path(__file__).with_name("snapshots")
NOT_RERUN = ("how-to/record-a-calibration.md", "how-to/what-did-my-sensor-see.md")
"""Pages whose sessions need a sensor, or recordings that their own test makes."""

SCENARIOS = {"whole.toml": WHOLE, "looped.toml": LOOPED, "alone.toml": SENSOR + ADMITTANCE + STILL}
"""Scenario files that are written next to the examples for a snapshot: complete, with a loop, and without a design."""

_FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
_STEP = re.compile(r"^(?:\$|>>>) (.+)\n((?:(?!\$ |>>> |```).*\n)*)", re.MULTILINE)
_BLOCK = re.compile(r"^```console\n(.*?)^```", re.MULTILINE | re.DOTALL)
_MASK = re.compile(r"(\d[\d.]*?)\.\.\.")


@dataclass(frozen=True, slots=True)
class Step:
    """A command of a session, what the page shows below it, and where that stands in the text of the page."""

    command: str
    shown: str
    start: int


def steps_of(text: str) -> list[Step]:
    """Return the commands of all console sessions of a page."""
    return [
        Step(found[1], found[2], block.start(1) + found.start(2))
        for block in _BLOCK.finditer(text)
        for found in _STEP.finditer(block[1])
    ]


def pages_with_sessions() -> list[Path]:
    """Return the README and the pages of the documentation whose sessions can be run again."""
    pages = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
    return [
        page
        for page in pages
        if page.relative_to(DOCS if page.is_relative_to(DOCS) else ROOT).as_posix() not in NOT_RERUN
        and any(step.command.startswith("pretouch ") for step in steps_of(page.read_text(encoding="utf-8")))
    ]


def agrees(shown: str, printed: str) -> bool:
    """Check whether a command prints what a page shows, in which `...` stands for any text."""
    return doctest.OutputChecker().check_output(shown, printed, _FLAGS)


def prints_the_same(shown: str, printed: str) -> bool:
    """Check whether a command prints the lines that a snapshot shows; `...` stands for any text in a line."""
    pattern = re.escape(shown.rstrip("\n")).replace(r"\.\.\.", ".*")
    return re.fullmatch(pattern, printed.rstrip("\n")) is not None


def run_page(page: Path, folder: Path) -> Iterator[tuple[Step, int, str]]:
    """Run the commands of a page one after the other, next to a copy of the examples.

    Yields:
        Each command of which the page shows the output, its exit status, and its output.
    """
    steps = [step for step in steps_of(page.read_text(encoding="utf-8")) if step.shown.strip()]
    shutil.copytree(ROOT / "examples", folder / "examples")
    beside = any("examples/" in step.command for step in steps)
    for step in steps:
        words = shlex.split(step.command)
        if words[0] == "pretouch":
            run = in_this_process(*words[1:], folder=folder if beside else folder / "examples")
            yield step, run.returncode, run.stdout if run.returncode < 2 else run.stdout + run.stderr


def run_snapshot(snapshot: Path, folder: Path) -> Iterator[tuple[Step, str]]:
    """Run the commands of a snapshot one after the other in a copy of the examples.

    Commands other than pretouch, which edit files, are run by the shell.

    Yields:
        Each command, and what a terminal shows: standard output and standard error, then an exit status other than 0.
    """
    shutil.copytree(ROOT / "examples", folder, dirs_exist_ok=True)
    for name, text in SCENARIOS.items():
        (folder / name).write_text(text, encoding="utf-8")
    names: dict[str, Any] = {"pt": pretouch, "np": np}
    text = snapshot.read_text(encoding="utf-8")
    for step in steps_of(text):
        if text[: step.start].splitlines()[-1].startswith(">>> "):
            yield step, _in_python(step.command, folder, names)
            continue
        edit, called, words = step.command.rpartition("pretouch ")
        if not called:
            edit, words = words, ""
        status, printed = 0, ""
        if edit:
            status, printed = _in_a_shell(edit.removesuffix("&& "), folder)
        if called and not status:
            line, _, given = words.partition(" < ")
            more = {"stdin": folder / given} if given else {}
            status, printed = as_in_a_terminal(*shlex.split(line), folder=folder, **more)
        yield step, printed + (f"exit status {status}\n" if status else "")


def _in_python(line: str, folder: Path, names: dict[str, Any]) -> str:
    """Run a line of Python, and return the value or the error that Python shows."""
    with contextlib.chdir(folder):
        try:
            value = eval(line, names) if " = " not in line.partition("(")[0] else exec(line, names)  # noqa: S307, S102 - our own page
        except (pretouch.errors.PretouchError, TypeError) as error:
            return f"{type(error).__name__}: {error}\n"
    return "" if value is None else f"{value!r}\n"


def _in_a_shell(line: str, folder: Path) -> tuple[int, str]:
    """Run a command that edits files, such as sed; `python` is the interpreter of this process."""
    line = re.sub(r"^python ", f"{shlex.quote(sys.executable)} ", line)
    run = subprocess.run(line, shell=True, cwd=folder, text=True, capture_output=True, check=False)  # noqa: S602 - our own page
    return run.returncode, run.stdout + run.stderr


def rewritten(page: Path, folder: Path) -> str:
    """Return the text of a page or snapshot with what its commands print now."""
    text, shift = page.read_text(encoding="utf-8"), 0
    if page.parent == SNAPSHOTS:
        runs = list(run_snapshot(page, folder))
    else:
        runs = [(step, printed) for step, _, printed in run_page(page, folder)]
    for step, printed in runs:
        start = step.start + shift
        new = renewed(step.shown, printed)
        text = text[:start] + new + text[start + len(step.shown) :]
        shift += len(new) - len(step.shown)
    return text


def renewed(shown: str, printed: str) -> str:
    """Return what a page shows of a new output: the same lines, with `...` where it had left out digits or lines."""
    if agrees(shown, printed):
        return shown
    gap = shown[len(shown.rstrip("\n")) :] or "\n"
    gap = "\n" + shown if not shown.strip() else gap
    old, new = shown.rstrip("\n").split("\n"), printed.rstrip("\n").split("\n")
    parts = [part.strip("\n").split("\n") for part in re.split(r"^\.\.\.$", "\n".join(old), flags=re.MULTILINE)]
    if len(parts) == 1:
        return "\n".join(_masked(line, old) for line in new) + gap
    lines: list[str] = []
    for i, part in enumerate(parts):
        if part != [""]:
            first = 0 if i == 0 else len(new) - len(part) if i == len(parts) - 1 else _closest(part, new)
            lines += [_masked(line, old) for line in new[max(first, 0) : first + len(part)]]
        lines += ["..."] * (i < len(parts) - 1)
    return "\n".join(lines) + gap


def _masked(line: str, old: list[str]) -> str:
    """Return a new line with the digits left out that the page left out in the same or the closest old line."""
    masked = [each for each in old if "..." in each and each != "..."]
    for each in masked:
        if agrees(each, line):
            return each
    with contextlib.suppress(IndexError):
        closest = difflib.get_close_matches(line, masked, n=1)[0]
        for digits in dict.fromkeys(_MASK.findall(closest)):
            line = re.sub(rf"(?<![\d.]){re.escape(digits)}[\d.]*\d", f"{digits}...", line)
    return line


def _closest(part: list[str], new: list[str]) -> int:
    ratios = [
        difflib.SequenceMatcher(None, "\n".join(part), "\n".join(new[i : i + len(part)])).ratio()
        for i in range(len(new))
    ]
    return ratios.index(max(ratios))
