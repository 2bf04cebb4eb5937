"""Simulate in MuJoCo how objects meet a robot with proximity sensors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from threading import Event
from typing import Any, Final, cast

import numpy as np

from pretouch._core.arguments import check_arguments
from pretouch._core.numbers import FloatArray, nonnegative, positive
from pretouch._core.warning_codes import with_context
from pretouch.simulation.result import whole

from .centering import Centering
from .compiled_run import Runner, RunResult
from .deviations import (
    ComparedRuns,
    explain_deviations,
    report_deviations,
    report_problems,
    report_rising_forces,
    report_touches,
    with_curved_paths_last,
)
from .model import Data, Model, check_model, mujoco, site_index, with_opaque_geoms
from .obstruction import beam_warnings, take_to_surface
from .projection import warnings_of_site
from .result import RobotSimulation, RobotTrace, prediction_of, touches_elsewhere
from .run_scene import RunScene
from .sight import FARTHEST, Sight
from .site_law import SiteLaw
from .tracking import ComputedTorque, Tracking

HORIZON: Final = 5.0
"""Default for the longest time that a run waits for the contact of all sites [s]."""

FOLLOW: Final = 0.02
"""Default for the time that a run continues at least after the last contact [s]."""


@check_arguments
def simulate_robot(
    model: Model,
    data: Data,
    laws: Sequence[SiteLaw],
    *,
    tracking: Tracking | None = None,
    centering: Centering | None = None,
    runs: int = 1,
    seed: int = 0,
    contact_stiffness: float | None = None,
    horizon: float = HORIZON,
    follow_time: float = FOLLOW,
    workers: int = 1,
) -> RobotSimulation:
    """Simulate how objects meet a robot with sampled control laws.

    The results are compared with the 1-D prediction. Each sensor sees the scene by rays, and has its own sensor chain
    and its own controller. The controllers move the references of their sites along axes that stay those of the start,
    relative to the base. The tracking makes the joints follow. The robot starts at rest, and the objects move as the
    state says.

    Laws on robots are one-sided by default, see `SiteLaw`: an object that leaves the beam looks like one that recedes.

    The drives apply the torques of the tracking within the force limits of the model. Actuators and their controls are
    not used otherwise.

    Args:
        model: a `mujoco.MjModel` with robot and objects. Its time step has to divide the period of the controllers.
        data: its state at the start, with the velocities of the objects.
        laws: the controllers, at most one per site, all with one period. The sites may be on several robots.
        tracking: how the joints follow; computed torque by default.
        centering: law that centers a hand between two opposed fingers; None for none. The prediction of a finger does
            not know it.
        runs: number of runs, each with its own noise and phase of the sensors.
        seed: seed of the noise.
        contact_stiffness: stiffness of the contact [N/m] for the predicted impact force; None for no prediction. Drives
            that push during the impact raise the simulated force, and the prediction has none.
        horizon: longest time to wait for the contact of all sites [s].
        follow_time: time to continue at least after the last contact [s]. A run continues until the force on the robot
            has passed its peak, for at most 1 s.
        workers: number of threads that share the runs.

    Returns:
        Contacts and largest values of every site and run, next to their prediction.
    """
    options = {
        "horizon": positive(horizon, "horizon", "s"),
        "follow_time": nonnegative(follow_time, "follow_time", "s"),
    }
    check_model(model)
    model, data, moved = _at_surface(with_opaque_geoms(model), data, laws)
    scene = RunScene.of(model, data, laws, tracking=tracking or ComputedTorque(), centering=centering, **options)
    stiffness = None if contact_stiffness is None else positive(contact_stiffness, "contact_stiffness", "N/m")
    count, seed = whole(runs, "runs", 1, 10**7), whole(seed, "seed", 0, 2**64 - 1)
    results = _simulate(scene, seed, count, whole(workers, "workers", 1, 1024))
    contacts = tuple(zip(*(result.contacts for result in results), strict=True))
    touches = tuple(result.touches for result in results)
    predictions = tuple(
        tuple(None if c.detection is None else prediction_of(law, c.detection, stiffness) for c in row)
        for law, row in zip(laws, contacts, strict=True)
    )
    return RobotSimulation(
        sites=tuple(law.site.name for law in laws),
        contacts=contacts,
        predictions=predictions,
        touches=touches,
        robot_forces=tuple(result.robot_force for result in results),
        warnings=with_curved_paths_last(
            (
                *report_problems([result.problems for result in results]),
                *report_touches(touches_elsewhere(touches)),
                *report_rising_forces([result.passed_peak for result in results]),
                *moved,
                *_warnings(
                    scene,
                    ComparedRuns(
                        model=scene.model,
                        drivetrains=scene.drivetrains,
                        laws=scene.laws,
                        contacts=contacts,
                        predictions=predictions,
                        touches=touches,
                        robot_forces=[result.robot_force for result in results],
                        stiffness=stiffness,
                        trace_of=_Tracer(scene, seed),
                    ),
                ),
            )
        ),
        laws=tuple(laws),
        model=scene.model,
        trace_of=_Tracer(scene, seed),
    )


def _at_surface(model: Model, data: Data, laws: Sequence[SiteLaw]) -> tuple[Model, Data, tuple[str, ...]]:
    """Return model and state with all sites at the surface of the robot, and a warning for each that was moved."""
    still = mujoco().MjData(model)
    still.qpos[:], still.qvel[:] = data.qpos, data.qvel
    mujoco().mj_kinematics(model, still)
    return take_to_surface(model, still, [law.site for law in laws])


def _warnings(scene: RunScene, comparison: ComparedRuns) -> Iterator[str]:
    """Yield all warnings of a robot simulation, on postures, model and deviations from the prediction."""
    names = [law.site.name for law in scene.laws]
    explanations = list(explain_deviations(names, comparison.contacts))
    if scene.centering is None:  # the prediction does not know the law of the hand
        explanations += report_deviations(comparison)
    for law in scene.laws:
        index, curve = site_index(scene.model, law.site.name), law.site.sensor
        sight = Sight(scene.model, law.site, index, cast("Any", curve), FARTHEST)
        for warning in (
            *warnings_of_site(scene.model, scene.data, law.site),
            *beam_warnings(scene.model, scene.data, index, sight),
        ):
            yield with_context(law.site.name, warning)
    yield from explanations


def _simulate(scene: RunScene, seed: int, runs: int, workers: int) -> list[RunResult]:
    """Simulate all runs, in several threads if there are several workers."""
    if workers == 1 or runs == 1:
        return _simulate_part(scene, seed, range(runs), Event())
    from concurrent.futures import ThreadPoolExecutor  # noqa: PLC0415 - only for several workers

    parts, stopped = [range(first, runs, workers) for first in range(min(workers, runs))], Event()
    with ThreadPoolExecutor(len(parts)) as pool:
        try:
            finished = list(pool.map(lambda part: _simulate_part(scene, seed, part, stopped), parts))
        except BaseException:  # also Ctrl-C: the other threads end after their present run
            stopped.set()
            raise
    return [finished[run % len(parts)][run // len(parts)] for run in range(runs)]


def _simulate_part(scene: RunScene, seed: int, runs: range, stopped: Event) -> list[RunResult]:
    runner = Runner(scene, seed)
    results = [runner.run(run) for run in runs if not stopped.is_set()]
    scene.path.adopt(runner.path)  # for a run that is repeated with its time series
    return results


@dataclass(frozen=True, slots=True)
class _Tracer:
    """Callable that repeats a simulated run and records its time series."""

    scene: Any
    seed: int

    def __call__(self, run: int) -> RobotTrace:
        blocks: list[FloatArray] = []
        Runner(self.scene, self.seed).run(run, blocks)
        rows, sites = np.vstack(blocks), len(self.scene.laws)
        widths = 1, sites, sites, sites, len(self.scene.drivetrains[0].driven)
        time, distance, reference, force, torque, posture = np.split(rows, np.cumsum(widths), axis=1)
        return RobotTrace(time[:, 0], distance, reference, force, torque, posture)
