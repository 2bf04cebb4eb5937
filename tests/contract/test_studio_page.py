"""The page of the studio in headless Chromium: drags, keyboard, undo, reload, two tabs, a lost server, bad files."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("playwright")

import pretouch as pt
from browser_checks import CHROMIUM, serious
from page_core import built_core
from pretouch._core.units import to_si
from pretouch.studio.page_file import figures_text, page_text
from pretouch.uncertainty import reservations_of
from studio_server import running_studio
from wrong_reading import write_task

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")


QUANTITIES = [
    *(("42.2 mm", "m"), ("3 µm", "m"), ("2 in", "m"), ("1.5e-3", "m"), ("250 g", "kg"), ("10 cm/s", "m/s")),
    *(("10 N*s/m", "N*s/m"), ("2 kN/m", "N/m"), ("474 1/m^2", "1/m^2"), ("5 rad/s", "rad/s"), ("3 m/s²", "m/s^2")),
    *(("0,3 m/s", "m/s"), ("-0,75 N*s", "N*s")),
]


@pytest.fixture(scope="module")
def static_file(tmp_path_factory):
    built_core()
    path = tmp_path_factory.mktemp("page") / "try.html"
    path.write_text(page_text(), encoding="utf-8")
    return path.as_uri()


@pytest.fixture(scope="module")
def scenario_file(tmp_path_factory):
    return shutil.copy(ROOT / "examples/loop.toml", tmp_path_factory.mktemp("files"))


@pytest.fixture(scope="module")
def server(scenario_file):
    with running_studio(scenario_file) as running:
        yield running


@pytest.fixture
def open_page(browser):
    contexts = []

    def make(address, *, context=None, width=1400, height=1000, **options):
        context = context or browser.new_context(viewport={"width": width, "height": height}, **options)
        contexts.append(context)
        page = context.new_page()
        page.mistakes, page.requests = [], []
        page.on("pageerror", lambda error: page.mistakes.append(str(error)))
        page.on("request", lambda request: page.requests.append(request.url))
        page.goto(address)
        page.wait_for_selector("html[data-ready]", timeout=60_000)
        return page

    yield make
    for context in dict.fromkeys(contexts):
        context.close()


def wait(page, expression, seconds=120):
    """Wait until an expression is true; the page's own policy forbids the `eval` of Playwright's function for this."""
    for _ in range(seconds * 20):
        if page.evaluate(expression):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"never true: {expression}")


def headline(page):
    return page.inner_text("#headline")


def drag(page, selector, across, *, start=0.4):
    page.locator(selector).scroll_into_view_if_needed()
    box = page.locator(selector).bounding_box()
    x, y = box["x"] + start * box["width"], box["y"] + 0.5 * box["height"]
    page.mouse.move(x, y)
    page.mouse.down()
    for i in range(1, 9):
        page.mouse.move(x + across * i / 8, y)
    page.mouse.up()
    wait(page, "!pretouch.frame")


def test_the_page_shows_the_design_of_python(open_page, static_file):
    page = open_page(static_file)
    task = pt.load_scenario(ROOT / "examples/approach.toml")
    design = pt.design(task)
    assert page.evaluate("pretouch.solved.gain") == pytest.approx(design.gain, rel=1e-9)
    speed = page.evaluate("pretouch.solved.contact.relative_velocity")
    assert speed == pytest.approx(design.result.contact.relative_velocity, rel=1e-9)
    assert "0.0791 m/s" in headline(page)
    assert page.mistakes == []
    assert [url for url in page.requests if not url.startswith(("file:", "data:", "blob:"))] == []


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("error", [0.1, 0.27], ids=["a range", "not supported"])
def test_the_range_of_contact_speeds_stands_next_to_the_result(open_page, tmp_path, error):
    with running_studio(write_task(tmp_path, error)) as running:
        page = open_page(running.address)
        wait(page, "pretouch.reservation && !pretouch.frame")
        task = pt.load_scenario(tmp_path / "task.toml")
        found = reservations_of(task.calibration, pt.design(task))
        assert page.inner_text("#reservation") == (found.headline or "")
        assert headline(page).endswith(found.spread or "without mitigation.")
        page.evaluate("pretouch.change((state) => (state.chosen = -0.001))")
        wait(page, "!pretouch.frame && document.getElementById('reservation').hidden")
        assert "readings also allow" not in headline(page)
        assert page.mistakes == []


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("kind", ["model", "calibration", "drag"])
def test_a_page_without_server_starts_with_the_scenario_of_a_file(open_page, tmp_path, kind):
    built_core()
    scenario, target = tmp_path / "cell.toml", tmp_path / "page.html"
    options = {
        "model": ["--speed", "0.45 m/s"],
        "calibration": [str(ROOT / "examples/sensor.csv"), "--recess", "8 mm"],
        "drag": ["--drag", "--speed", "0.2 m/s"],
    }[kind]
    for words in (["init", *options, "-o", scenario], ["studio", scenario, "--output", target]):
        done = subprocess.run([sys.executable, "-m", "pretouch", *words], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    task = pt.load_scenario(scenario)
    design = pt.design(task)
    page = open_page(target.as_uri())
    assert page.evaluate("pretouch.solved.gain") == pytest.approx(design.gain, rel=1e-6)
    speed = page.evaluate("pretouch.solved.contact.relative_velocity")
    assert speed == pytest.approx(design.result.contact.relative_velocity, rel=1e-6)
    assert page.inner_text("#name") == "cell.toml"
    assert "[chain]" in page.inner_text("#static-note")
    page.click("#toml")
    written = tmp_path / "written.toml"
    written.write_text(page.inner_text("#text"), encoding="utf-8")
    again = pt.load_scenario(written)
    assert again.scenario == task.scenario
    if kind != "drag":
        assert pt.design(again).gain == pytest.approx(design.gain, rel=1e-6)
    assert page.mistakes == []


def test_dragging_the_trade_off_changes_the_gain_and_undo_takes_it_back(open_page, static_file):
    page = open_page(static_file)
    before = headline(page)
    drag(page, "#trade .u-over", 120)
    gain = page.evaluate("pretouch.state.chosen")
    assert -10 <= gain < 0
    dragged = headline(page)
    assert "Chosen gain" in dragged
    page.click("#undo")
    assert headline(page) == before
    page.click("#redo")
    assert headline(page) == dragged
    page.keyboard.press("Control+z")
    assert headline(page) == before


def test_dragging_a_label_keeps_the_unit(open_page, static_file):
    page = open_page(static_file)
    drag(page, "label[for='obstacle.position']", 100, start=0.2)
    text = page.input_value("[id='obstacle.position']")
    number, unit = text.split()
    assert unit == "mm"
    assert float(number) == pytest.approx(42.2 * 2**0.5, rel=1e-3)
    page.click("#undo")
    assert page.input_value("[id='obstacle.position']") == "42.2 mm"


def test_the_keyboard_reaches_everything(open_page, static_file):
    page = open_page(static_file)
    page.focus("[id='admittance.mass']")
    page.keyboard.press("ArrowUp")
    assert page.input_value("[id='admittance.mass']") == "1.01 kg"
    page.focus("#gain")
    before = page.evaluate("pretouch.solved.gain")
    page.keyboard.press("ArrowRight")
    wait(page, f"pretouch.solved.gain !== {before}")
    seen = set()
    page.keyboard.press("Home")
    for _ in range(60):
        page.keyboard.press("Tab")
        seen.add(page.evaluate("document.activeElement.id"))
    assert {"pin", "toml", "python", "law", "model", "gain", "play", "slow", "time"} <= seen


@pytest.mark.parametrize(
    ("text", "word"), [("42.2 kg", "quantity in m"), ("abc", "quantity in m"), ("-3 mm", "positive"), ("", "missing")]
)
def test_a_mistake_stands_at_its_input_and_nothing_breaks(open_page, static_file, text, word):
    page = open_page(static_file)
    page.fill("[id='obstacle.position']", text)
    page.wait_for_selector("[id='obstacle.position'][aria-invalid='true']")
    assert word in page.inner_text("[id='obstacle.position-mistake']")
    page.fill("[id='obstacle.position']", "42.2 mm")
    page.wait_for_selector("[id='obstacle.position'][aria-invalid='false']")
    assert "0.0791 m/s" in headline(page)
    assert page.mistakes == []


def test_an_encounter_without_a_contact_says_so_and_shows_no_numbers_of_one(open_page, static_file):
    page = open_page(static_file)
    page.fill("[id='obstacle.velocity']", "+0.3 m/s")
    wait(page, "document.getElementById('headline').textContent.includes('No gain within the bounds ends in contact')")
    assert "time to contact" not in page.inner_text("#numbers")
    assert "not met" not in page.inner_text("#limits")
    page.select_option("#law", "virtual-drag")
    wait(page, "document.getElementById('headline').textContent.includes('does not approach')")
    assert "expected a negative velocity" in headline(page)
    assert "contact at" not in headline(page)
    page.fill("[id='obstacle.velocity']", "-0.3 m/s")
    wait(page, "document.getElementById('headline').textContent.includes('contact at')")
    assert page.mistakes == []


def test_pins_are_compared_and_used(open_page, static_file):
    page = open_page(static_file)
    first = headline(page)
    page.click("#pin")
    page.fill("[id='obstacle.velocity']", "-0.5 m/s")
    wait(page, "document.querySelector('#headline').textContent.includes('0.5 m/s without')")
    page.click("#pin")
    wait(page, "document.querySelectorAll('#compare tbody tr').length === 4")
    rows = page.locator("#compare tbody th").all_inner_texts()
    assert rows == ["now", "without mitigation", "A", "B"]
    page.click("button[aria-label='Use pin A']")
    wait(page, f"document.querySelector('#headline').textContent.includes({first[-40:]!r})")
    page.click("button[aria-label='Remove pin B']")
    wait(page, "document.querySelectorAll('#compare tbody tr').length === 3")


def test_the_drag_is_that_of_python(open_page, static_file):
    page = open_page(static_file)
    page.select_option("#law", "virtual-drag")
    page.fill("[id='law.ratio']", "0.15")
    wait(page, "pretouch.problem.ratio === 0.15")
    assert page.evaluate("pretouch.solved.gain") == pytest.approx(0.014371966606951, rel=1e-9)
    assert page.mistakes == []


def test_nothing_is_lost_on_reload_and_tabs_do_not_mix(open_page, static_file):
    page = open_page(static_file)
    page.fill("[id='obstacle.velocity']", "-0.45 m/s")
    page.keyboard.press("Tab")
    other = open_page(static_file, context=page.context)
    other.fill("[id='obstacle.velocity']", "-0.6 m/s")
    other.keyboard.press("Tab")
    page.reload()
    page.wait_for_selector("html[data-ready]")
    assert page.input_value("[id='obstacle.velocity']") == "-0.45 m/s"
    assert other.input_value("[id='obstacle.velocity']") == "-0.6 m/s"


def shown_text(page, button):
    page.click(button)
    page.wait_for_selector("#text-dialog[open]")
    text = page.inner_text("#text")
    page.click("#close")
    return text


@pytest.mark.parametrize("law", ["damper", "virtual-drag"])
def test_the_copied_python_and_the_scenario_do_the_same(open_page, static_file, tmp_path, law):
    page = open_page(static_file)
    page.fill("[id='obstacle.velocity']", "-0.4 m/s")
    page.fill("[id='sensor.recess']", "3 mm")
    page.select_option("#law", law)
    wait(page, "!pretouch.frame")
    number = page.evaluate("pretouch.solved.gain")
    names: dict[str, object] = {}
    exec(shown_text(page, "#python"), names)  # noqa: S102 - the program of the page is what is tested
    design = names["design"]
    found = design.drag if law == "virtual-drag" else design.gain
    assert found == pytest.approx(number, rel=1e-9)
    file = tmp_path / "scenario.toml"
    file.write_text(shown_text(page, "#toml"), encoding="utf-8")
    task = pt.load_scenario(file)
    found = pt.design(task).drag if law == "virtual-drag" else pt.design(task).gain
    assert found == pytest.approx(number, rel=1e-9)


def test_the_animation_runs_and_can_be_sought(open_page, static_file):
    page = open_page(static_file)
    page.select_option("#slow", "1")
    page.click("#play")
    wait(page, "Number(document.querySelector('#time').value) > 0.3")
    wait(page, "!pretouch.scene.playing")
    assert page.evaluate("pretouch.scene.now") == pytest.approx(0.46356, abs=1e-3)
    page.fill("#time", "0.1")
    assert page.evaluate("pretouch.scene.now") == pytest.approx(0.1, abs=2e-3)


def test_nothing_moves_by_itself(open_page, static_file):
    page = open_page(static_file, reduced_motion="reduce")
    assert page.evaluate("pretouch.scene.playing") is False
    assert page.evaluate("document.getAnimations().length") == 0


@pytest.mark.parametrize("width", [390, 768, 1400, 2560])
def test_the_page_fits_every_width(open_page, static_file, width):
    page = open_page(static_file, width=width)
    assert page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize("width", [390, 1400])
def test_controls_are_whole_and_verification_is_found_without_scrolling_far(open_page, server, width):
    page = open_page(server.address, width=width, height=844)
    page.evaluate("document.querySelector('#inputs').open = true")
    wait(page, "pretouch.state.disk !== undefined")
    boxes = "[...document.querySelectorAll('button, .file, select')].filter((e) => e.offsetParent)"
    assert page.evaluate(f"{boxes}.filter((e) => e.getClientRects().length !== 1).map((e) => e.id)") == []
    missing = "(e) => { const w = e.offsetWidth; e.style.width = 'max-content'; const n = e.offsetWidth; "
    missing += "e.style.width = ''; return n - w; }"
    selects = f"{boxes}.filter((e) => e.matches('select'))"
    assert page.evaluate(f"{selects}.map({missing}).filter((width) => width > 1)") == []
    page.evaluate("document.querySelector('#inputs').open = innerWidth >= 820")  # as the page starts
    ends = page.evaluate(
        "['verify', 'export', 'csv'].map((id) => document.getElementById(id).getBoundingClientRect().bottom)"
    )
    assert max(ends) < 844 * 1.5


@pytest.mark.parametrize(("excursion", "speed"), [("0.2 m", "0.1 m/s"), ("0.25 m", "0.1 m/s"), ("0.6 m", "0.29 m/s")])
def test_no_line_of_a_limit_crosses_the_label_of_another(open_page, static_file, excursion, speed):
    page = open_page(static_file)
    page.fill("[id='constraints.excursion']", excursion)
    page.fill("[id='constraints.relative_velocity']", speed)
    wait(page, "!pretouch.frame && pretouch.tradeChart.labels?.length === 2")
    lines = page.evaluate(
        "pretouch.problem.limits.map(({ name, limit }) => name === 'excursion' ? [1e3 * limit, 'e'] : [limit, 'v'])"
        ".map(([value, axis]) => pretouch.tradeChart.plot.valToPos(value, axis, true))"
    )
    labels = page.evaluate("pretouch.tradeChart.labels")
    assert [(line, label) for line in lines for label in labels if label["top"] < line < label["bottom"]] == []


def test_units_are_read_as_python_reads_them(open_page, static_file):
    page = open_page(static_file)
    for text, unit in QUANTITIES:
        found = page.evaluate("([text, unit]) => pretouch.parse(text, unit)", [text, unit])
        assert found == pytest.approx(to_si(text, unit, name=text, bare_text=True), rel=4e-16), text


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1400, 390])
def test_axe_has_no_serious_findings(open_page, static_file, scheme, width):
    page = open_page(static_file, width=width, color_scheme=scheme)
    page.evaluate("document.querySelector('#inputs').open = true")
    page.click("#pin")
    page.fill("[id='admittance.mass']", "x")
    page.wait_for_selector("[aria-invalid='true']")
    assert serious(page) == []


@pytest.mark.parametrize(("scheme", "width"), [("light", 1400), ("dark", 390)])
def test_no_state_of_the_studio_has_serious_findings(open_page, tmp_path, scheme, width):
    """A calibration, a running job, results, a dialog, a conflict, a bad file, and a lost server."""
    file = Path(shutil.copy(ROOT / "examples/loop.toml", tmp_path))
    found = {}
    with running_studio(file) as server:
        page = open_page(server.address, width=width, color_scheme=scheme)
        page.set_input_files("#csv", ROOT / "examples/sensor.csv")
        page.wait_for_selector("#fit:not([hidden])", timeout=60_000)
        page.click("#sweep")
        page.wait_for_selector("#jobs progress")
        found["running"] = serious(page)
        page.click("#jobs button")
        page.click("#simulate")
        page.click("#cloud")
        page.wait_for_selector("#job-text:not([hidden])")
        page.wait_for_selector("#cloud-figure:not([hidden])")
        wait(page, "!document.querySelector('#jobs progress')")
        found["results"] = serious(page)
        page.click("#python")
        page.wait_for_selector("#text-dialog[open]")
        found["dialog"] = serious(page)
        page.click("#close")
        file.write_text(file.read_text(encoding="utf-8") + "# a note\n", encoding="utf-8")
        page.click("#save")
        page.wait_for_selector("#conflict:not([hidden])")
        (tmp_path / "bad.csv").write_text("no table", encoding="utf-8")
        page.set_input_files("#csv", tmp_path / "bad.csv")
        wait(page, "document.querySelector('#csv-mistake').textContent !== ''")
        found["conflict"] = serious(page)
        server.stop()
        page.click("#simulate")
        page.wait_for_selector("#connection:not([hidden])")
        found["lost"] = serious(page)
    assert found == {state: [] for state in found}


# ---- with a server ----


def test_the_window_of_a_calibration_is_dragged(open_page, server):
    page = open_page(server.address)
    page.set_input_files("#csv", ROOT / "examples/sensor.csv")
    page.wait_for_selector("#fit:not([hidden])", timeout=60_000)
    before = page.inner_text("#fit-text")
    box = page.locator("#readings .u-over").bounding_box()
    page.locator("#readings").scroll_into_view_if_needed()
    box = page.locator("#readings .u-over").bounding_box()
    page.mouse.move(box["x"] + box["width"] - 2, box["y"] + 40)
    page.mouse.down()
    for i in range(1, 11):
        page.mouse.move(box["x"] + box["width"] * (1 - 0.05 * i), box["y"] + 40)
    page.mouse.up()
    wait(page, f"document.querySelector('#fit-text').textContent !== {before!r}")
    page.click("#whole")
    wait(page, f"document.querySelector('#fit-text').textContent === {before!r}")
    page.click("#use")
    wait(page, "pretouch.state.fields['sensor.calibration'] === 'sensor.csv'")
    page.click("#toml")
    page.wait_for_selector("#text-dialog[open]")
    wait(page, "document.querySelector('#text').textContent.includes('calibration = \"sensor.csv\"')")
    text = page.inner_text("#text")
    assert "# physical mass at the contact point" in text  # a comment of the file
    assert page.mistakes == []


@pytest.mark.parametrize(
    ("name", "content"), [("bad.csv", b"\x00\x01 no table"), ("empty.csv", b""), ("large.csv", None)]
)
def test_a_bad_file_is_a_sentence(open_page, server, tmp_path, name, content):
    page = open_page(server.address)
    file = tmp_path / name
    file.write_bytes(b"1,2\n" * 12_500_000 if content is None else content)  # 50 MB
    page.set_input_files("#csv", file)
    wait(page, "document.querySelector('#csv-mistake').textContent !== ''")
    if content is None:
        assert "50 MB" in page.inner_text("#csv-mistake")
    assert "0.0791 m/s" in headline(page)
    assert page.mistakes == []


def test_a_job_is_shown_again_after_a_reload(open_page, server):
    page = open_page(server.address)
    page.click("#sweep")
    page.wait_for_selector("#jobs li")
    page.reload()
    page.wait_for_selector("html[data-ready]")
    wait(page, "document.querySelector('#jobs').textContent.includes('Sweep over')")


def test_a_simulated_run_is_drawn_over_the_prediction(open_page, server):
    page = open_page(server.address)
    page.click("#simulate")
    wait(page, "document.querySelector('#distance-key').textContent.includes('simulated')")
    assert page.evaluate("pretouch.overlay.length") == 1
    drag(page, "#trade .u-over", 60)
    assert page.evaluate("pretouch.overlay") is None  # it was that of the gain before


def test_two_tabs_and_an_editor_do_not_overwrite_each_other(open_page, tmp_path):
    """Each version can be taken; until the user chooses, the file stays, and Undo returns to the page's values."""
    file = Path(shutil.copy(ROOT / "examples/loop.toml", tmp_path))
    with running_studio(file) as server:
        first = open_page(server.address)
        second = open_page(server.address, context=first.context)

        def set_speed(page, text):
            page.bring_to_front()
            wait(page, "pretouch.state.disk !== undefined")  # the page shows the file
            page.fill("[id='obstacle.velocity']", text)
            page.keyboard.press("Tab")

        set_speed(first, "-0.5 m/s")
        first.click("#save")
        wait(first, "document.querySelector('#save').textContent === 'Saved loop.toml'")
        set_speed(second, "-0.6 m/s")
        second.click("#save")
        second.wait_for_selector("#conflict:not([hidden])")
        assert '"-0.5 m/s"' in file.read_text(encoding="utf-8")
        second.click("#take")
        wait(second, "document.getElementById('obstacle.velocity').value === '-0.5 m/s'")
        assert second.is_hidden("#conflict")
        second.click("#undo")
        wait(second, "document.getElementById('obstacle.velocity').value === '-0.6 m/s'")
        file.write_text(file.read_text(encoding="utf-8") + "# a note\n", encoding="utf-8")  # an editor
        second.click("#save")
        second.wait_for_selector("#conflict:not([hidden])")
        assert file.read_text(encoding="utf-8").endswith("# a note\n")
        second.click("#overwrite")
        wait(second, "document.querySelector('#save').textContent === 'Saved loop.toml'")
        assert '"-0.6 m/s"' in file.read_text(encoding="utf-8")
        assert first.mistakes == second.mistakes == []


def test_what_is_typed_before_the_file_has_loaded_stays(browser, scenario_file):
    with running_studio(scenario_file) as server:
        page, held = browser.new_page(), []

        def hold(route):
            held.append(route)

        page.route("**/api/reload", hold)
        page.goto(server.address)
        page.wait_for_selector("[id='obstacle.velocity']")
        wait(page, "true")
        page.fill("[id='obstacle.velocity']", "-0.55 m/s")
        for _ in range(200):
            if held:
                break
            page.wait_for_timeout(20)
        held[0].continue_()
        page.wait_for_selector("html[data-ready]", timeout=60_000)
        assert page.input_value("[id='obstacle.velocity']") == "-0.55 m/s"
        assert page.input_value("[id='constraints.relative_velocity']") == "0.1 m/s", "the file is loaded"
        assert page.evaluate("document.activeElement.id") == "obstacle.velocity"
        assert page.evaluate("pretouch.state.base['obstacle.velocity']") == "-0.3 m/s"
        page.click("#undo")
        assert page.input_value("[id='obstacle.velocity']") == "-0.3 m/s"
        page.close()


def test_a_lost_server_loses_nothing(open_page, scenario_file):
    with running_studio(scenario_file) as server:
        page = open_page(server.address)
        page.fill("[id='obstacle.velocity']", "-0.5 m/s")
        page.keyboard.press("Tab")
        server.stop()
        page.click("#simulate")
        page.wait_for_selector("#connection:not([hidden])")
        page.fill("[id='admittance.mass']", "2 kg")
        wait(page, "pretouch.problem.encounter[0] === 2")
        assert page.input_value("[id='obstacle.velocity']") == "-0.5 m/s"
        assert page.mistakes == []


# ---- live figures ----


@pytest.mark.parametrize("name", ["gain", "drag", "pedestal", "encounter"])
def test_a_live_figure_is_mounted_in_another_document(browser, tmp_path, name):
    built_core()
    (tmp_path / "figures.js").write_text(figures_text(), encoding="ascii")
    head = '<!doctype html><html lang="en"><title>x</title><script src="figures.js"></script>'
    html = f'{head}<div data-pretouch-figure="{name}"></div>'
    (tmp_path / "index.html").write_text(html, encoding="utf-8")
    page = browser.new_page()
    mistakes = []
    page.on("pageerror", lambda error: mistakes.append(str(error)))
    page.goto((tmp_path / "index.html").as_uri())
    page.wait_for_selector("canvas")
    if name != "encounter":
        before = page.inner_text("output")
        assert before
        page.fill("input", page.evaluate("document.querySelector('input').min"))
        assert page.inner_text("output") != before
    assert mistakes == []
    page.close()
