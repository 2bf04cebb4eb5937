"""What each command prints, sentence by sentence: one page per command, rewritten by `make words`."""

from __future__ import annotations

from pathlib import Path

import pytest
from sessions import SNAPSHOTS, prints_the_same, renewed, run_snapshot

from pretouch.designs.quantities import CONSTRAINT_NAMES, QUANTITY_KINDS, QUANTITY_UNITS

NEEDED = {"project": "mujoco", "sweep": "xarray", "python": "xarray", "replay": "mcap"}
"""Libraries of extras, by the command that needs them."""

VERBS = sorted(path.stem for path in SNAPSHOTS.glob("*.md"))


@pytest.fixture(autouse=True)
def only_built_in_quantities(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take away the quantities that other tests define, which messages would list as well."""
    own = set(QUANTITY_UNITS) - set(QUANTITY_KINDS.names())
    for names in (QUANTITY_UNITS, CONSTRAINT_NAMES):
        for name in own & set(names):
            monkeypatch.delitem(names, name)


@pytest.mark.parametrize("verb", VERBS)
def test_a_command_prints_what_its_snapshot_shows(verb: str, tmp_path: Path) -> None:
    if verb in NEEDED:
        pytest.importorskip(NEEDED[verb], reason="needs an extra")
    for step, printed in run_snapshot(SNAPSHOTS / f"{verb}.md", tmp_path):
        assert prints_the_same(step.shown, printed), f"$ {step.command}\n{printed}\nIf that is intended: make words"


def test_a_new_output_keeps_what_the_page_left_out() -> None:
    assert renewed("a 1.2... mm\nb\n", "a 1.23 mm\nb\n") == "a 1.2... mm\nb\n"
    assert renewed("first\nup to 1.2... mm\n\n", "first\nat most 1.23 mm\nnew\n") == "first\nat most 1.2... mm\nnew\n\n"
    assert renewed("a\n...\nx\n", "A\nb\nc\nX\n") == "A\n...\nX\n"
    assert renewed("...\nthe middle is shown\n...\n", "a\nthe middle shown\nb\n") == "...\nthe middle shown\n...\n"
