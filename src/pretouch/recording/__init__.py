"""Record sensor calibrations, and replay robot recordings with the control law."""

from .joint_states import distances_from_joints
from .law_run import replay
from .reading import read_recording
from .recording import Recording
from .result import Replay

__all__ = ["Recording", "Replay", "distances_from_joints", "read_recording", "replay"]
