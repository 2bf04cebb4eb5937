"""Reports in headless Chromium: no serious finding of axe-core, nothing too wide, and links that open sections."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

pytest.importorskip("playwright")

import pretouch as pt
from browser_checks import CHROMIUM, serious
from verification_samples import NOISY, velocity_limit, verdict

EXAMPLES = Path(__file__).parents[2] / "examples"
SOURCE = {"name": "loop.toml", "text": (EXAMPLES / "loop.toml").read_text(encoding="utf-8")}
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")


@cache
def page_of(kind: str) -> str:
    if kind == "verdict":
        return pt.report.report_html(verdict(NOISY, constraints=[velocity_limit(0.05)], changes=False), source=SOURCE)
    if kind == "fit":
        return pt.report.report_html(pt.fit(pt.read_calibration(EXAMPLES / "sensor.csv")), source=SOURCE)
    task = pt.load_scenario(EXAMPLES / "tradeoff.toml")
    return pt.report.report_html(pt.design(task), source=SOURCE)


@pytest.mark.parametrize("kind", ["verdict", "fit", "design"])
@pytest.mark.parametrize(("scheme", "width"), [("light", 1400), ("dark", 390)])
def test_a_report_has_no_serious_findings_and_fits_the_page(browser, tmp_path, kind, scheme, width):
    path = tmp_path / "report.html"
    path.write_text(page_of(kind), encoding="utf-8")
    page = browser.new_page(viewport={"width": width, "height": 800}, color_scheme=scheme)
    page.goto(path.as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.evaluate("document.querySelectorAll('details').forEach((section) => (section.open = true))")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert serious(page) == []
    page.close()


def test_a_link_to_a_closed_section_opens_it(browser, tmp_path):
    path = tmp_path / "report.html"
    path.write_text(page_of("verdict"), encoding="utf-8")
    page = browser.new_page()
    page.goto(path.as_uri())
    closed = page.evaluate("document.querySelector('details:not([open]) > div').id")
    page.goto(f"{path.as_uri()}#{closed}")
    assert page.evaluate(f"document.getElementById('{closed}').parentElement.open")
    page.close()
