"""Which tests reach which lines: recorded once for each group of tests, and again when its tests change."""

from __future__ import annotations

import difflib
import hashlib
import importlib.util
import json
import os
import shutil
import subprocess
import sys
from collections import defaultdict
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from coverage import CoverageData

CHILD = """
import os

if "PYTEST_CURRENT_TEST" in os.environ:
    from mutants.recorder import record_child

    record_child()
"""
"""What Python imports at the start of each process of a recording, as sitecustomize."""

MARKS = """
#include <stddef.h>
#include <stdint.h>
#define SIZE (1 << 23)
#define OPEN __attribute__((visibility("default")))
extern const char __ehdr_start __attribute__((visibility("hidden")));
OPEN const size_t mutants_size = SIZE;
OPEN uint8_t mutants_entered[SIZE];
void __sanitizer_cov_trace_pc(void);
void __sanitizer_cov_trace_pc(void) {
    size_t place = (uintptr_t)__builtin_return_address(0) - (uintptr_t)&__ehdr_start;
    if (place < SIZE) mutants_entered[place] = 1;
}
"""
"""What gcc calls at the start of each block of code that it compiles with -fsanitize-coverage=trace-pc."""


def build_module(root: Path) -> Any:
    """Return native/build.py of a tree as a module."""
    spec = importlib.util.spec_from_file_location("pretouch_build", root / "native/build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def marking_jobs(build: Any, compilers: tuple[list[str], list[str]]) -> list[list[str]]:
    """Return the commands that compile each source such that its blocks are marked, without where the objects go."""
    flags = ["-fvisibility=hidden", "-fPIC", "-g", "-fsanitize-coverage=trace-pc"]
    jobs: list[list[str]] = build._jobs(compilers, flags, build.this_target().split("-", 1)[1])
    return jobs


def marking_library(root: Path, folder: Path) -> Path:
    """Return the core of a tree, compiled such that it marks the blocks that it enters; needs gcc and addr2line."""
    native = [text for path, text in sources(root).items() if path.startswith("native/")]
    made = folder / f"library-{hashlib.sha256(''.join(native).encode()).hexdigest()[:16]}" / "libpretouch.so"
    if made.exists():
        return made
    build = build_module(root)
    compilers = build.compilers()
    if compilers is None or shutil.which("addr2line") is None:
        raise SystemExit("recording what tests reach needs gcc and addr2line")
    made.parent.mkdir(parents=True, exist_ok=True)
    objects = []
    for i, job in enumerate(marking_jobs(build, compilers)):
        objects.append(str(made.with_name(f"{i}.o")))
        subprocess.run([*job, "-o", objects[-1]], check=True)
    marks = made.with_name("marks.c")
    marks.write_text(MARKS)
    partial = made.with_suffix(".partial")
    cc = compilers[0]
    subprocess.run([*cc, "-O2", "-fPIC", "-shared", str(marks), *objects, "-o", str(partial), "-lm"], check=True)
    partial.replace(made)
    build.write_record(made, build.interface())  # without which Python refuses to load it
    return made


def groups(root: Path) -> dict[str, list[str]]:
    """Return what is recorded together, by name: each file of tests, and the examples of each room of the package."""
    found = {path.stem: [str(path.relative_to(root))] for path in sorted((root / "tests").glob("*/test_*.py"))}
    rooms = [p for p in sorted((root / "src/pretouch").iterdir()) if p.is_dir() and any(p.glob("*.py"))]
    for room in rooms:
        found[f"src-{room.name}"] = [str(room.relative_to(root))]
    found["src-top"] = [str(p.relative_to(root)) for p in sorted((root / "src/pretouch").glob("*.py"))]
    return found


def tests_digest(root: Path, paths: list[str]) -> str:
    """Return a digest of the tests in files or folders, without what lies around their examples."""
    digest = hashlib.sha256()
    for path in paths:
        whole = root / path
        for one in sorted(whole.rglob("*.py")) if whole.is_dir() else [whole]:
            text = one.read_text(encoding="utf-8")
            kept = text.splitlines() if path.startswith("tests") else [x for x in text.splitlines() if ">>>" in x]
            digest.update("\n".join(kept).encode())
    return digest.hexdigest()


def sources(root: Path) -> dict[str, str]:
    """Return the text of every source that can be changed, by its path."""
    native = [p for part in ("core", "law") for p in sorted((root / "native" / part).glob("*.[ch]*"))]
    every = [*sorted((root / "src").rglob("*.py")), *native]
    return {str(path.relative_to(root)): path.read_text(encoding="utf-8") for path in every}


def record(root: Path, folder: Path, name: str, paths: list[str]) -> None:
    """Run a group of tests, and keep what they reach, how long they take and which fail."""
    library = marking_library(root, folder)
    digest, work = tests_digest(root, paths), folder / "work"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    (work / "sitecustomize.py").write_text(CHILD)
    path = [work, root / "tests", root / "tools", root / "src"]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(map(str, path)),
        "PRETOUCH_LIBRARY": str(library),
        "MUTANTS_FOLDER": str(work),
    }
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", "-p", "mutants.recorder", *paths]
    done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, check=False)
    if done.returncode not in {0, 1, 5} or not (work / "outcomes.json").exists():
        raise SystemExit(f"could not record {name}:\n{done.stdout[-3000:]}{done.stderr[-3000:]}")
    from mutants.recorder import gather

    lines = work / "gathered"
    gather(work, library, root, lines)
    lines.replace(folder / f"{name}.lines")
    snapshot = json.dumps(sources(root))
    kept = folder / f"sources-{hashlib.sha256(snapshot.encode()).hexdigest()[:16]}.json"
    if not kept.exists():
        kept.write_text(snapshot)
    known = {"digest": digest, "sources": kept.name, "outcomes": json.loads((work / "outcomes.json").read_text())}
    (folder / f"{name}.json").write_text(json.dumps(known))
    shutil.rmtree(work)


@dataclass(frozen=True)
class Reach:
    """Which tests reach which lines of the sources as they are now.

    Args:
        root: the tree.
        seconds: of processor time that each test takes.
        failing: tests that fail without any change; they tell nothing.
        by_line: the tests that reach each line of a file.
    """

    root: Path
    seconds: dict[str, float] = field(default_factory=dict)
    failing: set[str] = field(default_factory=set)
    by_line: dict[str, dict[int, set[str]]] = field(default_factory=lambda: defaultdict(lambda: defaultdict(set)))

    def add(self, folder: Path, name: str) -> None:
        """Add what a group reaches; where lines have moved since it was recorded, they are followed."""
        known = json.loads((folder / f"{name}.json").read_text())
        for test, (seconds, ok) in known["outcomes"].items():
            self.seconds[test] = seconds
            if not ok:
                self.failing.add(test)
        data = CoverageData(str(folder / f"{name}.lines"))
        data.read()
        for measured in data.measured_files():
            parts = Path(measured).parts
            start = max((i for i, part in enumerate(parts) if part in {"src", "native"}), default=None)
            if start is None:
                continue
            path = str(Path(*parts[start:]))
            now = self._moved(folder / known["sources"], path)
            for line, tests in data.contexts_by_lineno(measured).items():
                if line in now:
                    self.by_line[path][now[line]].update(filter(None, tests))

    def _moved(self, snapshot: Path, path: str) -> dict[int, int]:
        before, whole = read_snapshot(snapshot).get(path), self.root / path
        if before is None or not whole.exists():
            return {}
        return moved(before, whole.read_text(encoding="utf-8"))

    def tests(self, path: str, lines: range) -> set[str]:
        """Return the tests that reach any of these lines, and that pass without a change."""
        here = self.by_line.get(path, {})
        return set().union(*(here[line] for line in lines if line in here)) - self.failing


@cache
def read_snapshot(path: Path) -> dict[str, str]:
    """Read the sources as they were when a group was recorded."""
    return json.loads(path.read_text())  # type: ignore[no-any-return]


@cache
def moved(before: str, now: str) -> dict[int, int]:
    """Return where each line of a text is now; one that was changed is where the new lines in its place end."""
    old, new, found = before.splitlines(), now.splitlines(), {}
    if old == new:
        return {i: i for i in range(1, len(new) + 1)}
    for _, i, i2, k, k2 in difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        for n in range(i, i2):
            found[n + 1] = min(k + n - i, max(k2 - 1, k)) + 1
    return found
