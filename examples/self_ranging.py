"""Self-ranging: a custom law that estimates the distance and varies a virtual drag between two rails.

    python examples/self_ranging.py

For an inverse power curve, y = xi^(-1/n) = theta (l + l_0) is linear in the distance l, with one unknown theta for
the reflectance. The robot's own retreat is known, so theta is observable, and a linear Kalman filter estimates
distance and speed. The drag is the one for a constant deceleration over that distance, limited to the range between
two constant drags. So the guarantee of the weak one holds, however wrong the estimate is (docs/explanation/drag.md). An
exponential curve is refused: there a brighter object looks like a nearer one at every distance, so the distance is
not observable.

The program prints contact speed and excursion over five reflectances, compared with the constant drag that has the
same excursion at 0.3 m/s. There the contact speed is about 17 % lower. The law gains nothing if the object
accelerates, which the filter does not expect. It then stays at its weak rail. Its guarantee is that of the weak
rail only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

import pretouch as pt
from pretouch import control
from pretouch.control import Controller, Observation, Output, Parts, Sample, VirtualDrag
from pretouch.designs.drag import DragLimits, predict_drag

SPREAD = 0.45  # expected standard deviation of ln reflectance: half and twice are 1.5 standard deviations away


class Memory(NamedTuple):
    """State of the law between two steps.

    Args:
        drag: state of the virtual drag.
        mean: estimates of y, of the rate dy/dt that the object causes, and of theta = dy/dl.
        covariance: of these three estimates.
        position: of the plant at the previous reading [m].
        phi: the current drag [N s^2].
    """

    drag: Any
    mean: Any
    covariance: Any
    position: float
    phi: float


@dataclass(frozen=True, kw_only=True)
class SelfRanging:
    """A drag between two rails, for a constant deceleration over the distance that a Kalman filter estimates.

    Args:
        drag: noise, dead zone and smoothing of the drag; its phi is not used.
        rails: the weak and the strong constant drag, for the calibrated sensor curve.
        share: desired contact speed over approach speed.
        sway: expected standard deviation of the object's acceleration [m/s^2].
    """

    drag: VirtualDrag
    rails: DragLimits
    share: float = 0.12
    sway: float = 0.2

    def __post_init__(self) -> None:
        if not isinstance(self.sensor, pt.InversePower):
            raise pt.errors.InvalidInputError(
                f"sensor: found {type(self.sensor).__name__}, expected InversePower: along an exponential a brighter "
                "object reads as a nearer one at every distance, so the distance is not observable"
            )

    @property
    def sensor(self) -> Any:
        """The calibrated sensor curve."""
        return self.rails.weak.sensor

    @property
    def theta(self) -> float:
        """Parameter theta at the reflectance of the calibration, xi^(-1/n) per meter."""
        return float(self.sensor.scale ** (-1 / self.sensor.exponent))

    @property
    def continuous(self) -> str:
        """The law by which predictions are made: the virtual drag of the weak rail."""
        return "virtual-drag"

    @property
    def value(self) -> float:
        """The drag of the weak rail [N s^2]."""
        return float(self.rails.weak.drag)

    @property
    def step(self) -> Any:
        """The step of the law, as a method with access to rails and curve."""
        return self._step

    def with_value(self, value: float) -> SelfRanging:
        """Return the law with another weak rail [N s^2]."""
        weak = self.rails.weak
        made = predict_drag(weak.sensor, weak.detection_distance, weak.mass, value)
        return replace(self, rails=replace(self.rails, weak=made))

    def numbers(self, controller: Any) -> Any:
        """Return the parameters of the drag for phi = 1 N s^2; the impulse is proportional to phi."""
        return self.drag.with_value(1.0).numbers(controller)

    def start(self) -> Memory:
        """Return the state before the first reading."""
        return Memory(self.drag.start(), None, None, 0.0, self.value)

    def _step(self, parameters: Parts, state: Parts, sample: Sample) -> tuple[Parts, Output]:
        sensing, seen = control.observe(parameters.sensing, state.sensing, sample)
        drag, push = control.push_by_drag(parameters.law, state.law.drag, seen, state.drive)
        law = state.law._replace(drag=drag)
        if seen.usable:
            motion = state.drive.motion
            law = self._estimated(law, seen, parameters.law, motion.position)
            law = law._replace(phi=self._chosen(law, parameters.law.mass, motion.velocity))
        push.impulse *= law.phi
        driven, output = control.drive(parameters.drive, state.drive, seen, push, sample)
        return Parts(sensing, driven, law), output

    def _estimated(self, law: Memory, seen: Observation, numbers: Any, position: float) -> Memory:
        """Update the linear Kalman filter of (y, dy/dt by the object, theta) with a reading."""
        n = self.sensor.exponent
        y = seen.level ** (-1 / n)
        variance = (y / n) ** 2 * (numbers.variance / seen.level**2 + numbers.relative_variance)
        if seen.restarted or law.mean is None:
            spread = np.diag([variance, self.theta**2, (self.theta * SPREAD / n) ** 2])  # speeds of about 1 m/s
            return law._replace(mean=np.array([y, 0.0, self.theta]), covariance=spread, position=position)
        t, given = seen.elapsed, position - law.position
        ahead = np.array([[1.0, t, -given], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        push = self.sway * law.mean[2] * np.array([t * t / 2, t, 0.0])
        mean, spread = ahead @ law.mean, ahead @ law.covariance @ ahead.T + np.outer(push, push)
        share = spread[:, 0] / (spread[0, 0] + variance)
        mean, spread = mean + share * (y - mean[0]), spread - np.outer(share, spread[0])
        return law._replace(mean=mean, covariance=spread, position=position)

    def _chosen(self, law: Memory, mass: float, velocity: float) -> float:
        """Return phi [N s^2] for a constant deceleration to the desired share of the speed, within the rails."""
        y, by_object, theta = law.mean
        rate = -self.sensor.exponent * (by_object - theta * velocity) / y  # s' = -n y'/y, without theta
        theta = min(max(theta, 0.6 * self.theta), 1.6 * self.theta)
        distance = max(y / theta - self.sensor.distance_offset, 1e-3)
        first = -by_object / theta  # initial velocity of the object
        now = first + velocity
        force = mass * max(now**2 - (self.share * first) ** 2, 0.0) / (2 * distance)
        weak, strong = self.rails.weak.drag, self.rails.strong.drag
        return float(min(max(force / rate**2, weak), strong)) if rate > 0 else float(weak)


START = 0.0422
SENSOR = pt.InversePower(scale=0.533, distance_offset=0.0419, exponent=3.32)
NOISE = VirtualDrag(drag=1.0, noise=20.0, relative_noise=3e-3, resolution=4.0)
RAILS = DragLimits(weak=predict_drag(SENSOR, START, 1.0, 0.0122), strong=predict_drag(SENSOR, START, 1.0, 0.0227))
CONSTANT = NOISE.with_value(0.0127)
CHAIN = pt.SensorChain(
    **{"rate": 250.0, "delay": 2e-3, "noise": 20.0, "relative_noise": 3e-3, "resolution": 4.0},
    **{"offset": 50.0, "random_phase": True},
)
PLANT = pt.simulation.ImpedancePlant(mass=1.0, stiffness=4000.0, damping=126.0, bandwidth=80.0)
SETTINGS = ((0.3, 0.0), (0.05, 0.0), (1.0, 0.0), (0.3, -0.5), (0.3, -2.0))  # speed and acceleration of the object


def controller_of(law: Any) -> Controller:
    """Return a controller of 1 kHz for a sensor of 250 Hz."""
    return Controller(
        period=1e-3,
        conditioning=control.Conditioning(floor=100.0, sensor_period=4e-3),
        law=law,
        admittance=control.VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
    )


def encounters(law: Any, speed: float, acceleration: float = 0.0, runs: int = 25) -> tuple[Any, Any]:
    """Return contact speeds [m/s] and excursions [m] for objects half to twice as bright as in the calibration."""
    scenario = pt.Scenario(
        admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        obstacle=pt.Obstacle(position=START, velocity=-speed, acceleration=acceleration),
    )
    found = [
        pt.simulation.simulate_loop(
            scenario, sensor, controller_of(law), chain=CHAIN, plant=PLANT, runs=runs, seed=number
        )
        for number, sensor in enumerate(replace(SENSOR, scale=0.533 * r) for r in np.geomspace(0.5, 2.0, 5))
    ]
    return -np.ravel([f.relative_velocity for f in found]), np.ravel([f.largest_excursion for f in found])


def main() -> None:
    """Print one line per setting."""
    print(f"{'':22}{'self-ranging':>28}{'constant drag':>28}")
    print(f"{'':22}{'mean, 95 % [mm/s]':>20}{'[mm]':>8}" + f"{'mean, 95 % [mm/s]':>20}{'[mm]':>8}")
    for speed, acceleration in SETTINGS:
        row = f"{speed:g} m/s, {acceleration:g} m/s^2"
        cells = [encounters(law, speed, acceleration) for law in (SelfRanging(drag=NOISE, rails=RAILS), CONSTANT)]
        words = [f"{1e3 * s.mean():14.1f}{1e3 * np.quantile(s, 0.95):6.1f}{1e3 * w.mean():8.1f}" for s, w in cells]
        print(f"{row:22}{''.join(words)}")


if __name__ == "__main__":
    main()
