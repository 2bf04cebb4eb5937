"""[[obstacle.course]]: read as it is written, and every mistake told by line and key."""

from __future__ import annotations

import re

import pytest

import pretouch as pt
from loop_text import LOOPED
from pretouch.config import load_scenario
from pretouch.motion import Stretch
from scenario_text import STILL, places, replaced, writer

FIRST = '[[obstacle.course]]\nuntil = "50 ms"\n'
SECOND = '[[obstacle.course]]\nuntil = "0.2 s"\nacceleration = "3 m/s^2"\n'
COURSE = STILL + FIRST + SECOND
WITH = replaced(STILL, COURSE)


@pytest.fixture
def write(tmp_path, monkeypatch):
    return writer(tmp_path, monkeypatch)


def test_a_course_is_read(write):
    course = (Stretch(until=0.05), Stretch(until=0.2, acceleration=3.0))
    assert load_scenario(write(WITH)).scenario.obstacle == pt.Obstacle(
        position=0.0422, velocity=-0.3, acceleration=0.0, course=course
    )


# (what is replaced, by what, the start of the line that is named, key)
MISTAKES = [
    ('"50 ms"', '"50 mm"', 'until = "50', "obstacle.course[0].until"),
    ('"50 ms"', '"0 s"', 'until = "0 s"', "obstacle.course[0].until"),
    ('"50 ms"', '"inf"', 'until = "inf"', "obstacle.course[0].until"),
    ('"0.2 s"', '"50 ms"', 'until = "50 ms"\nacc', "obstacle.course[1].until"),
    ('"0.2 s"', '"20 ms"', 'until = "20 ms"', "obstacle.course[1].until"),
    ('"3 m/s^2"', '"3 m/s"', 'acceleration = "3 m', "obstacle.course[1].acceleration"),
    ('until = "0.2 s"\n', "", "[[obstacle.course]]\nacc", "obstacle.course[1].until"),
    ('until = "50 ms"', 'untl = "50 ms"', "untl", "obstacle.course[0].untl"),
    (FIRST + SECOND, "course = 3\n", "course", "obstacle.course"),
    (FIRST + SECOND, "course = []\n", "course", "obstacle.course"),
    (FIRST + SECOND, '[obstacle.course]\nuntil = "1 s"\n', "[obstacle.course]", "obstacle.course"),
    (FIRST, '[[obstacle.corse]]\nuntil = "50 ms"\n', "[[obstacle.corse]]", "obstacle.corse"),
]


@pytest.mark.parametrize(("old", "new", "start", "key"), MISTAKES)
def test_mistakes_are_told_by_line_and_key(write, old, new, start, key):
    text = replaced(old, new, WITH)
    assert (text[: text.index(start)].count("\n") + 1, key) in places(write(text))


def test_a_loop_from_a_file_runs_a_course(write):
    stops = '[[obstacle.course]]\nuntil = "10 ms"\nacceleration = "30 m/s^2"\n'
    text = re.sub(r"(\[obstacle\]\n(?:\w.*\n)*)", rf"\1{stops}", LOOPED, count=1)
    assert stops in text
    task = load_scenario(write(text))
    run = task.loop.run(task.scenario, task.sensor, 0.0)
    assert not run.touched
    assert run.closest_distance < task.scenario.distance
    assert pt.simulate(task.replace(gain=0.0)).run.closest_distance == run.closest_distance
