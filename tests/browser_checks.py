"""Check pages in headless Chromium with axe-core."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Open headless Chromium for the tests of a file: its event loop would disturb other tests in this process."""
    playwright_of = pytest.importorskip("playwright.sync_api").sync_playwright
    with playwright_of() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield opened
        opened.close()


@lru_cache(maxsize=1)
def axe() -> str:
    """Return axe-core, which npm fetches once into build/; it is not part of pretouch."""
    folder = ROOT / "build/axe"
    script = folder / "package/axe.min.js"
    if not script.exists():
        if shutil.which("npm") is None:
            pytest.skip("npm is not installed, and axe-core is not in build/axe")
        folder.mkdir(parents=True, exist_ok=True)
        command = ["npm", "pack", "axe-core@4", "--silent"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=120)
        if done.returncode:
            pytest.skip("axe-core cannot be fetched")
        subprocess.run(["tar", "xzf", done.stdout.split()[-1]], cwd=folder, check=True)
    return script.read_text(encoding="utf-8")


def serious(page: Any) -> list[Any]:
    """Return the serious and critical findings of axe-core on a page."""
    page.evaluate(axe())
    found = page.evaluate("axe.run()")["violations"]
    return [(v["id"], [n["target"] for n in v["nodes"]][:4]) for v in found if v["impact"] in {"serious", "critical"}]
