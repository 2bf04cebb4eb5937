"""Pages that are written from tables of the program are the ones in the repository."""

from __future__ import annotations

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROGRAM = ROOT / "docs" / "make_pages.py"


def test_the_pages_are_those_that_their_program_writes() -> None:
    spec = importlib.util.spec_from_file_location("make_pages", PROGRAM)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    made = dict(module.pages())
    assert len(made) > 3
    for path, text in made.items():
        assert (ROOT / "docs" / path).read_text(encoding="utf-8") == text, f"{path}: run python docs/make_pages.py"
