"""The virtual drag on a noisy loop compared with the letter's optimum: benchmarks/drag.py with 100 encounters."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.drag import AT_ONCE, LEAVING, LETTER, SETTINGS, Setting, Size, after_it, figures, run

SIZE = Size(20, 5)  # means to 0.15 mm/s and 0.3 mm at 0.3 m/s, to 0.5 mm/s at 1 m/s; the nearest limit is 1.8 mm away
BY_NAME = {setting.name: setting for setting in SETTINGS}


@pytest.mark.parametrize("name", ["0.3 m/s", "1 m/s"])
def test_it_keeps_what_is_asked_and_is_better_than_the_letter_at_once(name: str) -> None:
    setting = BY_NAME[name]
    letter, drag = (figures(run(setting, law, SIZE)) for law in (LETTER, setting.drag()))
    assert setting.asked
    for figure, limit in setting.asked:
        assert drag[figure] <= limit, figure
    for figure in AT_ONCE:
        assert drag[figure] < letter[figure], figure


@pytest.mark.parametrize("setting", LEAVING, ids=[setting.name for setting in LEAVING])
def test_it_goes_nowhere_after_an_object_that_leaves(setting: Setting) -> None:
    """What came before it turned is driven home by the admittance alone, as fast as that is from there."""
    few = Size(4, 3)
    result = run(setting, setting.drag(), few)
    ahead, fast = after_it(result)
    assert ahead == 0.0
    away = 1e3 * result.largest_excursion.max()
    # from rest, aperiodic with D = 2 M w_0: x~' <= w_0 |x~(0)|/e with w_0 = 5/s; the servo follows 80 Hz
    assert fast <= 1.02 * 5.0 / math.e * away
    assert after_it(run(setting, LETTER, few))[0] > 40.0
