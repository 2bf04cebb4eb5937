"""
What did my sensor really see?
==============================

A recording of a real sensor, and what the law does with it.
"""

import pretouch as pt
from pretouch.recording import replay
from pretouch.recording.reading import read_recordings

task = pt.load_scenario("../../examples/loop.toml")
reading, truth = read_recordings("../../examples/approaches.csv", ("reading", "contact"))
figure = pt.plots.replay(replay(task.replace(gain=-0.86), reading, truth=truth))
