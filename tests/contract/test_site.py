"""The check of the built site finds broken links, missing figures and whatever would be fetched from elsewhere."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = '<html><body><h1 id="top">x</h1>{}</body></html>'


def check(site: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / "docs/check_site.py"), str(site)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_sound_site_passes(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text(
        PAGE.format('<a href="other.html#top">x</a><a href="https://example.org">y</a>')
    )
    (tmp_path / "other.html").write_text(PAGE.format('<img src="a.png"><a href="#top">x</a>'))
    (tmp_path / "a.png").touch()
    answer = check(tmp_path)
    assert answer.returncode == 0, answer.stdout
    assert "2 pages" in answer.stdout


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.html", '<a href="none.html">x</a>', "leads nowhere"),
        ("a.html", '<a href="#none">x</a>', "no such section"),
        ("a.html", '<script src="https://example.org/x.js"></script>', "fetches https://example.org/x.js"),
        ("a.html", '<img src="//example.org/x.png">', "fetches //example.org/x.png"),
        ("a.html", '<link rel="stylesheet" href="https://example.org/x.css">', "fetches"),
        ("plot_01.html", "no picture", "has no figure"),
        ("a.css", '@import "https://example.org/x.css";', "fetches https://example.org/x.css"),
        ("a.css", "b { src: url(https://example.org/f.woff) }", "fetches https://example.org/f.woff"),
    ],
)
def test_a_fault_of_the_site_is_named(name: str, content: str, told: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(PAGE.format(content) if name.endswith(".html") else content)
    answer = check(tmp_path)
    assert answer.returncode == 1
    assert told in answer.stdout
    assert name in answer.stdout


def test_the_gallery_has_24_programs_that_keep_their_figure() -> None:
    programs = sorted((ROOT / "docs/gallery").glob("plot_*.py"))
    assert len(programs) == 24
    for path in programs:
        assert "\nfigure = " in path.read_text(encoding="utf-8"), path.name
