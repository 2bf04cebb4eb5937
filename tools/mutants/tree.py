"""The copy of the tree that is changed: never the tree itself."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
WORK = ROOT / "build/mutants"
TREE = WORK / "tree"
KINDS = {".py", ".hpp", ".cpp", ".h", ".c", ".toml", ".csv", ".md"}
"""Files that are removed from the copy when they are gone from the tree."""


def tree_files() -> list[str]:
    """Return the files of the tree that git knows or does not ignore."""
    command = ["git", "ls-files", "-co", "--exclude-standard", "-z"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return sorted(name for name in listed.split("\0") if name and (ROOT / name).is_file())


def copy_tree() -> None:
    """Make the copy what the tree is: a mutant that a killed run left there is undone, too."""
    names = tree_files()
    for name in names:
        source, copied = ROOT / name, TREE / name
        if not copied.exists() or copied.read_bytes() != source.read_bytes():
            copied.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, copied)
            forget_compiled(copied)
    wanted = set(names)
    for part in ("src", "native", "tests", "tools", "examples", "benchmarks", "docs"):
        for path in (TREE / part).rglob("*"):
            kept = path.suffix not in KINDS or not path.is_file() or str(path.relative_to(TREE)) in wanted
            if not kept:
                path.unlink()


def write(name: str, text: str) -> None:
    """Change a file of the copy."""
    path = TREE / name
    path.write_text(text, encoding="utf-8")
    forget_compiled(path)


def forget_compiled(path: Path) -> None:
    """Remove what Python compiled of a module: it takes a change of the same size in the same second for none."""
    for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        compiled.unlink(missing_ok=True)


def build_library() -> bool:
    """Compile the core of the copy in place; tell whether that succeeded."""
    command = [sys.executable, "native/build.py"]
    environment = {**os.environ, "JOBS": "1"}
    return subprocess.run(command, cwd=TREE, env=environment, capture_output=True, check=False).returncode == 0
