"""The check of the built site finds broken links, missing figures and whatever would be fetched from elsewhere."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import pretouch as pt
from figure_checks import visible_texts
from pretouch.report import Curve, Panel, panel_figure

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


@pytest.fixture
def extensions(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Import a module of the site's build."""
    monkeypatch.syspath_prepend(ROOT / "docs/_ext")
    return lambda name: sys.modules.get(name) or __import__(name)


@pytest.mark.parametrize("columns", [1, 2, 3])
def test_the_columns_of_a_picture_are_whole(columns: int, extensions: Any, tmp_path: Path) -> None:
    """Each axis with all its texts lies within one column; a page shows the picture once, and once in parts."""
    x = np.linspace(0.0, 1.0, 50)
    panels = [
        Panel(
            x_label="time [s]", y_label=f"force {i} [N]", title=f"Panel {i}", curves=[Curve(x=x, y=i * x, label="one")]
        )
        for i in range(1, 2 * columns + 1)
    ]
    figure = panel_figure(*panels, columns=columns)
    visible_texts(figure)  # lays the figure out
    path = tmp_path / "picture.png"
    figure.savefig(path)
    narrow = extensions("narrow_figures")
    parts = narrow.columns_of(path)
    assert [start for start, _ in parts] + [1.0] == [0.0] + [end for _, end in parts]
    assert len(parts) == columns
    size = figure.get_figwidth() * figure.dpi
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    assert all(sum(s * size <= box.x0 and box.x1 <= e * size for s, e in parts) == 1 for box in boxes)
    html = narrow.adapted('<img alt="words" src="_images/picture.png" />', path)
    assert html.count("data-drawn") == (1 if columns == 1 else 1 + columns)
    assert html.count('alt="words"') == (1 if columns == 1 else 2), "the other parts have no name of their own"


def test_a_picture_of_a_robot_keeps_its_colors(extensions: Any) -> None:
    narrow = extensions("narrow_figures")
    drawn = {path.stem: narrow.is_drawn(path) for path in (ROOT / "docs/images").glob("*.png")}
    assert sorted(name for name, is_drawn in drawn.items() if not is_drawn) == [
        "robot-film",
        "robot-grasp",
        "robot-thrown-ball",
    ]


def test_the_first_page_shows_the_figures_of_its_own_numbers(extensions: Any) -> None:
    drawing = extensions("page_drawing")
    page = (ROOT / "docs/start.md").read_text(encoding="utf-8")
    drawn: dict[str, Figure] = {name: drawing.draw(code, {}) for name, code in drawing.figures_of(page).items()}
    assert {name: len(figure.axes) for name, figure in drawn.items()} == {"calibration": 4, "gain": 4}
    (gain,) = re.findall(r"^Optimal gain D_p = -([\d.]+) N s", page, re.MULTILINE)
    assert any(f"D\u209a = \u2212{gain} N s" in text for text, _ in visible_texts(drawn["gain"]))
    report = pt.fit(pt.read_calibration(ROOT / "examples/sensor.csv"))
    assert f"g = {report.best.middle_slope.value:.4g} 1/m" in page.replace("\n", " ")
    assert "images/" not in page
