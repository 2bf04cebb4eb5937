"""docs/how-to/good-calibration.md quotes what the program prints of its cases, and shows their pictures."""

import importlib
import re
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from figure_checks import assert_legible

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to/good-calibration.md").read_text(encoding="utf-8")
SECTIONS = re.split(r"^## ", PAGE, flags=re.MULTILINE)
NAMES = re.findall(r"!\[[^\]]+\]\(\.\./images/calibration-([a-z-]+)\.png\)", PAGE)


@pytest.fixture(scope="module")
def drawn():
    """The program that draws the pictures, with its cases."""
    sys.path.insert(0, str(ROOT / "examples"))
    try:
        yield importlib.import_module("calibration_pictures")
    finally:
        sys.path.remove(str(ROOT / "examples"))


def plain(text):
    return " ".join(text.split())


def holds(text, quoted):
    """Tell whether all pieces between ellipses stand in a text, in this order."""
    start = 0
    for piece in map(plain, quoted.split("...\n")):
        start = text.find(piece, start)
        if start < 0:
            return False
    return True


def test_every_picture_of_the_program_stands_in_the_page_and_every_section_has_one(drawn):
    assert sorted(NAMES) == sorted(drawn.pictures())
    assert len(SECTIONS) == len(NAMES)
    assert all("images/calibration-" in section for section in SECTIONS)


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("name", NAMES)
def test_what_a_section_quotes_is_what_is_printed(drawn, name):
    section = next(s for s in SECTIONS if f"calibration-{name}.png" in s)
    quotes = re.findall(r"```text\n(.*?)```", section, re.DOTALL)
    said = [plain(str(drawn.report(case))) for case in drawn.pictures()[name].cases]
    assert quotes
    for quoted in quotes:
        assert any(holds(text, quoted) for text in said), quoted


def test_the_worked_example_of_the_other_page_is_what_is_printed(drawn):
    page = (ROOT / "docs" / "explanation/calibration.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```text\n(.*?)```", page, re.DOTALL)
    assert plain(example) in plain(str(drawn.report("good")))


@pytest.mark.slow(keep=1)
@pytest.mark.parametrize("name", NAMES)
def test_a_picture_is_legible_and_the_one_that_is_shown(drawn, name):
    from matplotlib.image import imread

    picture = drawn.pictures()[name]
    assert_legible(picture.draw())
    content = BytesIO()
    drawn.write(picture, content)
    content.seek(0)
    now, shown = imread(content), imread(ROOT / "docs" / "images" / f"calibration-{name}.png")
    assert now.shape == shown.shape
    # the pinned matplotlib gives the same pixels; other versions shade the edges of letters and curves differently,
    # 5 % of a picture by a tenth or so: 0.005. A window that starts elsewhere by a tenth of the axis changes less
    # than that, so the numbers of the quotes hold those; a curve or a label that goes missing changes more
    assert float(np.mean(np.abs(now - shown))) < 0.005


def slopes(drawn, name, distance):
    found = drawn.report(name)
    return float(found.best.sensor.log_slope(distance)), float(drawn.cases()[name].slope(np.array([distance]))[0])


@pytest.mark.slow
def test_the_numbers_that_the_page_tells_beside_its_quotes(drawn):
    known = drawn.report("offset measured").slope.largest
    assert f"determines the slope g to {100 * known:.2g} %" in plain(PAGE)
    too_low = drawn.report("offset too low").best
    fitted, true = slopes(drawn, "offset too low", 0.055)
    assert f"R^2 is {too_low.r_squared:.3f}" in plain(PAGE)
    assert 0.4 < fitted / true < 0.6  # "half of the true one far away"
    soft = drawn.cases()["soft saturation"]
    contact = np.array([0.0])
    assert round(float(drawn.through_all(soft)(contact)[0] / soft.slope(contact)[0])) == 13
    wavy, distance = drawn.cases()["misfit"], drawn.report("misfit").best.distances
    ripple = np.log(wavy.signal(distance) / drawn.cases()["good"].signal(distance))
    assert f"{100 * np.sqrt(np.mean(ripple**2)):.1f} % RMS" in plain(PAGE)
    peaked = drawn.cases()["near-field peak"]
    assert float(peaked.slope(np.array([0.004]))[0]) > 0
