"""Read what a robot recorded, run the sampled law over it, and compare the sensor with its description."""

from .reading import read_recording
from .recording import Recording
from .replay import replay
from .result import Replay

__all__ = ["Recording", "Replay", "read_recording", "replay"]
