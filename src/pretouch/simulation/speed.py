"""Compute the highest approach speed at which a virtual drag works.

Up to this speed, the control loop is stable and reacts in time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from pretouch._core.arguments import check_arguments
from pretouch._core.values import Value
from pretouch.motion import DRAG, Admittance, Obstacle, Scenario
from pretouch.sensors import SensorModel

from .chain import LoopTiming
from .robot import PlantModel
from .stability import gain_limit

_LAG: Final = 0.25  # allowed motion within the lag, in detection distances; a drag acts too late from 0.3 to 0.4 on


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedLimit(Value):
    """Two limits of the approach speed with a virtual drag.

    Below one limit, the loop is stable. Below the other, it reacts in time.

    Args:
        stable: the approach speed v above which 2 phi g^2 |l'| exceeds the largest stable damping at some distance
            [m/s]; infinite for phi = 0. For an object at constant speed, |l'| = v exp(-(phi/M) int g^2 dl), integrated
            from l to the start.
        critical_distance: the distance at which this damping is exceeded first [m].
        timely: l_d / 4 over the lag, delay + 2 tau_s + hold [m/s]: an estimate. If an object moves by 0.3 to 0.4 of the
            detection distance l_d within the lag, the drag acts too late, and the contact speed is too high.
    """

    stable: float
    critical_distance: float
    timely: float

    @property
    def speed(self) -> float:
        """The highest approach speed [m/s] below both limits.

        Up to this speed, the loop is stable and reacts in time.
        """
        return min(self.stable, self.timely)


@check_arguments
def speed_limit(
    sensor: SensorModel,
    admittance: Admittance,
    timing: LoopTiming,
    drag: float,
    *,
    detection_distance: float,
    plant: PlantModel | None = None,
) -> SpeedLimit:
    """Find the highest approach speeds at which a virtual drag works.

    Up to one speed, the loop is stable. Up to the other, it reacts in time.

    Args:
        sensor: the sensor curve.
        admittance: one virtual admittance.
        timing: the timing of the loop, with the smoothing of its law, as from `timing_of`.
        drag: phi [N s^2], >= 0.
        detection_distance: l_d [m], at which the object is first detected.
        plant: the robot behind the virtual object; ideal by default.

    Returns:
        Both speeds, for objects at constant speed.

    Examples:
        >>> from pretouch.sensors import InversePower
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> admittance = Admittance(mass=1.0, damping=10.0, stiffness=25.0)
        >>> timing = LoopTiming(rate=250.0, delay=0.0025, smoothing=0.007)
        >>> limit = speed_limit(sensor, admittance, timing, 0.01437, detection_distance=0.0422)
        >>> round(limit.stable, 1), round(limit.timely, 2)
        (5.3, 0.51)
    """
    approach = Scenario(admittance=admittance, obstacle=Obstacle(position=detection_distance, velocity=-1.0))
    motion = DRAG.motion(approach, sensor, drag)
    limit = gain_limit(
        sensor,
        admittance,
        timing,
        distance=motion.distance,
        plant=plant,
        law=DRAG,
        relative_velocity=motion.relative_velocity,
    )
    return SpeedLimit(
        stable=math.inf if drag == 0 else limit.strongest / drag,
        critical_distance=limit.critical_distance,
        timely=_LAG * detection_distance / (timing.delay + 2 * timing.smoothing + timing.holding),
    )
