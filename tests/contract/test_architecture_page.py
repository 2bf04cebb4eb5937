"""The page on the architecture names every folder, and only files and names that exist."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "pretouch"
DEVELOPERS = ROOT / "docs" / "developers"
PAGE = (DEVELOPERS / "architecture.md").read_text(encoding="utf-8")
ENDING = r"(?:/|\.py|\.pyi|\.md|\.toml|\.html|\.[ch](?:pp)?)"
FILE = re.compile(rf"`((?:[\w.-]+/)*[\w.-]*{ENDING})`")
PLACED = re.compile(r"`(\w+)`(?: of the verb)? (?:in|of) `((?:[\w.-]+/)*[\w.-]+\.\w+)`")


def located(name: str) -> Path | None:
    """Return the file or folder that a page names, relative to the package or to the repository."""
    return next((base / name for base in (SOURCE, SOURCE.parent, ROOT) if (base / name).exists()), None)


def test_every_folder_has_one_row() -> None:
    folders = {
        f"{path.parent.relative_to(SOURCE).as_posix()}/"
        for path in SOURCE.rglob("*.*")
        if path.suffix in {".py", ".js"} and path.parent != SOURCE
    }
    folders = {name for name in folders if "templates/" not in name and "vendor" not in name}
    assert len(folders) > 20
    assert {name for name in folders if f"`{name}`" not in PAGE} == set()


def test_the_rows_are_in_the_order_of_the_layers() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    layers = [layer.split(" | ") for layer in contracts[0]["layers"]]
    rows = re.findall(r"^\| `(\w+)/` \|", PAGE, re.MULTILINE)
    assert sorted(rows) == sorted(name for layer in layers for name in layer)
    level = {name: i for i, layer in enumerate(layers) for name in layer}
    assert [level[name] for name in rows] == sorted(level.values())


@pytest.mark.parametrize("page", sorted(DEVELOPERS.glob("*.md")), ids=lambda page: page.stem)
def test_every_file_that_a_page_names_exists(page: Path) -> None:
    named = FILE.findall(page.read_text(encoding="utf-8"))
    files = [name for name in named if "/" in name]
    assert [name for name in files if located(name) is None] == []


def test_every_name_is_where_the_page_says() -> None:
    placed = PLACED.findall(PAGE)
    assert len(placed) > 15
    for name, file in placed:
        path = located(file)
        assert path is not None, file
        text = path.read_text(encoding="utf-8")
        assert re.search(rf"^\s*(def|class) {name}\b|^{name}\b.*=", text, re.MULTILINE), (name, file)


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("next step", "`_steps` in `verification/next_step.py`"),
        ("noise of a sensor part", "`PARTS` in `simulation/parts.py`"),
        ("PT406", "`docs/warnings/PT406.md`"),
        ("legend", "`pareto` in `report/pareto_figures.py`"),
    ],
)
def test_a_reader_finds_where_to_change_what(question: str, answer: str) -> None:
    rows = [line for line in PAGE.splitlines() if line.startswith("|") and question in line.split("|")[1]]
    assert len(rows) == 1
    assert answer in rows[0]


def test_the_index_for_developers_starts_with_the_page() -> None:
    index = (DEVELOPERS / "README.md").read_text(encoding="utf-8")
    assert index.index("architecture.md") < index.index("native.md")
