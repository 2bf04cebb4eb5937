"""Measure the page of pretouch studio in headless Chromium: from the mouse to the picture, first paint, sizes.

    python -m benchmarks.studio              all figures; needs Chromium and playwright
    python -m benchmarks.studio --moves 400  so many moves of the mouse for each kind of drag

The times of the core are measured in the same browser, so that they can be compared with those of Python next to them.
"""

from __future__ import annotations

import argparse
import gzip
import importlib.metadata
import os
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.designs import Task, design_gain
from pretouch.designs.objectives import excursion_objective
from pretouch.motion import Admittance, Obstacle, Scenario, find_contact
from pretouch.sensors import InversePower
from pretouch.studio.page_file import figures_text, page_text

TARGETS = {"median": 16.0, "95 %": 40.0, "first paint": 500.0, "page": 256.0, "extra": 20.0}
EXTRA = ("starlette", "uvicorn", "tomlkit", "anyio", "h11", "idna", "click", "typing_extensions")


def drag(page: Any, moves: int, x: float, y: float, width: float) -> np.ndarray:
    """Drag the mouse to and fro, at the rate of a mouse, and return the delays until the picture [ms]."""
    delays: list[float] = []
    page.mouse.move(x, y)
    page.mouse.down()
    for i in range(moves):
        page.mouse.move(x + width * np.sin(i / 12.0), y)
        if i % 50 == 49:
            delays += page.evaluate("pretouch.delays.splice(0)")
    page.mouse.up()
    return np.array(delays[10:])


def row(name: str, value: float, unit: str, target: float | None = None) -> None:
    required = "" if target is None else f"  required {target:g}  {'met' if value <= target else 'MISSED'}"
    print(f"{name:52s} {value:9.2f} {unit}{required}")


def measure_drags(browser: Any, address: str, moves: int) -> None:
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    page.goto(address)
    page.wait_for_selector("html[data-ready]")
    page.wait_for_timeout(300)
    box = page.locator("#trade .u-over").bounding_box()
    gains = drag(page, moves, box["x"] + box["width"] / 2, box["y"] + 60, box["width"] / 4)
    label = page.locator("label[for='obstacle.position']").bounding_box()
    inputs = drag(page, moves, label["x"] + 30, label["y"] + 8, 60)
    for name, delays in (("the gain", gains), ("an input", inputs)):
        row(
            f"drag of {name} to the picture, median of {len(delays)}", float(np.median(delays)), "ms", TARGETS["median"]
        )
        row(f"drag of {name}, 95th percentile", float(np.quantile(delays, 0.95)), "ms", TARGETS["95 %"])
    page.close()


def measure_first_paint(browser: Any, address: str) -> None:
    script = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? -1"
    paints, ready = [], []
    for _ in range(7):
        page = browser.new_page(viewport={"width": 1400, "height": 1000})
        page.goto(address)
        page.wait_for_selector("html[data-ready]")
        ready.append(page.evaluate("performance.now()"))
        page.wait_for_timeout(200)
        paints.append(page.evaluate(script))
        page.close()
    row("first paint, median of 7", float(np.median(paints)), "ms", TARGETS["first paint"])
    row("all figures drawn, median of 7", float(np.median(ready)), "ms")


def measure_core(browser: Any, address: str) -> None:
    """Compare contacts and designs in the browser with Python; Python's designs include its checks and evidence."""
    page = browser.new_page()
    page.goto(address)
    page.wait_for_selector("html[data-ready]")
    script = """(kind) => {
        const { core, problem } = pretouch, gains = Array.from({ length: 200 }, (_, i) => -0.01 * 1000 ** (i / 199));
        const task = { ...problem, limits: problem.rows };
        const designs = () => { for (let i = 0; i < 50; i++) core.design(problem.encounter, problem.curve, task); };
        const contacts = () => core.solve(problem.encounter, problem.curve, gains, 600);
        const run = kind === "design" ? designs : contacts, times = [];
        for (let k = 0; k < 15; k++) { const t = performance.now(); run(); times.push(performance.now() - t); }
        return Math.min(...times) / (kind === "design" ? 50 : 200);
    }"""
    scenario = Scenario(
        admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0), obstacle=Obstacle(position=0.0422, velocity=-0.3)
    )
    sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
    task = Task(scenario, sensor, excursion_objective(position_scale=0.5, velocity_scale=0.3), bounds=(-10.0, -0.01))
    calls = {"contact": lambda: find_contact(scenario, sensor, -0.7463), "design": lambda: design_gain(task)}
    for kind, call in calls.items():
        best = np.inf
        for _ in range(7):
            start = time.perf_counter()
            for _ in range(20):
                call()
            best = min(best, (time.perf_counter() - start) / 20)
        ours = 1e3 * page.evaluate(script, kind)
        python = 1e6 * best
        print(f"{f'one {kind} in the page':52s} {ours:9.2f} µs   Python {python:7.1f} µs   ratio {ours / python:.2f}")
    page.close()


def measure_sizes() -> None:
    page, figures = page_text().encode(), figures_text().encode()
    row("page as one file", len(page) / 1e3, "kB", TARGETS["page"])
    row("page, compressed", len(gzip.compress(page)) / 1e3, "kB")
    row("live figures as one script", len(figures) / 1e3, "kB", TARGETS["page"])
    size = 0
    for name in EXTRA:
        files = importlib.metadata.files(name) or []
        size += sum(path.stat().st_size for f in files if (path := Path(str(f.locate()))).is_file())
    row("what the extra installs", size / 1e6, "MB", TARGETS["extra"])


def main() -> None:
    """Print all figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--moves", type=int, default=400, help="moves of the mouse for each kind of drag")
    wanted = parser.parse_args()
    print(f"\npretouch studio; {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    measure_sizes()
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        print("Chromium is not installed: nothing is measured in the browser")
        return
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - the sizes need no browser

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        file = Path(folder, "try-it.html")
        file.write_text(page_text(), encoding="utf-8")
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        address = file.as_uri()
        measure_first_paint(browser, address)
        measure_drags(browser, address, wanted.moves)
        measure_core(browser, address)
        browser.close()


if __name__ == "__main__":
    main()
