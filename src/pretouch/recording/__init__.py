"""Record sensor calibrations, and replay robot recordings with the control law."""

from .law_run import replay
from .reading import read_recording
from .recording import Recording
from .result import Replay

__all__ = ["Recording", "Replay", "read_recording", "replay"]
