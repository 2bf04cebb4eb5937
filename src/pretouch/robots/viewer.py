"""Replay a simulated encounter in MuJoCo's interactive viewer."""

from __future__ import annotations

import os
import sys
import time
from typing import Any, Final

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError, require

from .model import mujoco
from .rendering import visual_model
from .result import RobotSimulation

SLOWER: Final = 10.0
"""Factor by which a replay is slower than the encounter."""

_RATE: Final = 50.0  # Hz, of the frames
_PAUSE: Final = 1.0  # s, at the end of each replay


@check_arguments
def view_robot(result: RobotSimulation, run: int = 0) -> None:
    """Replay one simulated run in MuJoCo's viewer.

    The replay is in slow motion, until the user closes the window.

    Args:
        result: the result of `simulate_robot`.
        run: number of the run.

    Raises:
        InvalidInputError: there is no display, or MuJoCo cannot open its viewer.
    """
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InvalidInputError(
            "view: found no display, but MuJoCo's viewer opens a window; run it in a desktop session, or look at the "
            "film in the report"
        )
    trace, library = result.trace(run), mujoco()
    try:
        viewer: Any = require("mujoco.viewer", extra="mujoco")
        model = visual_model(result.model)
        data = library.MjData(model)
        data.qpos[:] = trace.configuration[0]
        library.mj_forward(model, data)
        window = viewer.launch_passive(model, data)
    except (ImportError, RuntimeError) as error:
        raise InvalidInputError(
            "view: MuJoCo cannot open its viewer; look at the film in the report instead. "
            f"MuJoCo reports the error: {' '.join(str(error).split())}"
        ) from None
    step = 1 / (_RATE * SLOWER)
    rows = np.searchsorted(trace.time, np.arange(0.0, trace.time[-1] + step, step)).clip(max=len(trace.time) - 1)
    with window:
        while window.is_running():
            for row in rows:
                if not window.is_running():
                    break
                data.qpos[:] = trace.configuration[row]
                library.mj_forward(model, data)
                window.sync()
                time.sleep(1 / _RATE)
            time.sleep(_PAUSE)
