"""Record sensor calibrations, and replay robot recordings with the control law."""

from .calibration_recheck import Recheck, recheck
from .law_run import replay
from .reading import read_recording
from .recording import Recording
from .result import Replay

__all__ = ["Recheck", "Recording", "Replay", "read_recording", "recheck", "replay"]
