"""Rewrite the output of pretouch that snapshots, README and documentation quote.

Called by `make words`, with the names of pages or parts of their paths; without names, all are rewritten.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from sessions import ROOT, SNAPSHOTS, pages_with_sessions, rewritten


def main(names: list[str]) -> None:
    """Rewrite the pages of which the path contains one of the names."""
    for page in [*sorted(SNAPSHOTS.glob("*.md")), *pages_with_sessions()]:
        path = page.relative_to(ROOT).as_posix()
        if names and not any(name in path for name in names):
            continue
        before = page.read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as folder:
            after = rewritten(page, Path(folder))
        if after != before:
            page.write_text(after, encoding="utf-8")
            print(f"{path}: rewritten; look at the change with git diff")


if __name__ == "__main__":
    main(sys.argv[1:])
