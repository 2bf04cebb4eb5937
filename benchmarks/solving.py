"""Time one contact and one design, compared with SciPy on the same problem, with their accuracy."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

import pretouch as pt

SCENARIO = pt.Scenario(
    admittance=pt.Admittance(mass=1.0, damping=10.0, stiffness=25.0),
    obstacle=pt.Obstacle(position=0.0422, velocity=-0.3),
)
SENSORS = {
    "exponential-1": pt.ExponentialFirstOrder(scale=0.458, rate=-61.0),
    "inverse-power": pt.InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32),
}
OBJECTIVE = pt.excursion_objective(position_scale=0.5, velocity_scale=0.3)


def scipy_contact(sensor: pt.sensors.SensorModel, gain: float) -> tuple[float, float, float]:
    """Solve one contact by DOP853 with a terminal event, as an expert would; return time, x and l'."""
    slope = (lambda l: -3.32 / (l + 0.0419)) if sensor.name == "inverse-power" else (lambda _: -61.0)  # noqa: E741

    def motion(t: float, y: np.ndarray) -> tuple[float, float]:
        force = 10 * (-0.3 - y[1]) + 25 * (0.0422 - 0.3 * t - y[0]) - gain * slope(y[0]) * y[1]
        return y[1], force

    def touch(_: float, y: np.ndarray) -> float:
        return y[0]

    touch.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(motion, (0, 60), (0.0422, -0.3), method="DOP853", rtol=1e-11, atol=1e-14, events=touch)
    t, l_dot = float(found.t_events[0][0]), float(found.y_events[0][0][1])
    return t, 0.0422 - 0.3 * t, l_dot


def scipy_design(sensor: pt.sensors.SensorModel) -> float:
    """Minimize over SciPy's contacts by bounded Brent, a local search that suffices for this objective."""

    def objective(log_gain: float) -> float:
        _, x, l_dot = scipy_contact(sensor, -float(np.exp(log_gain)))
        return (x / 0.5) ** 2 + (l_dot / 0.3) ** 2

    found = minimize_scalar(objective, bounds=(np.log(0.01), np.log(10)), method="bounded", options={"xatol": 1e-9})
    return -float(np.exp(found.x))


def measure(ours: Callable[[], object], theirs: Callable[[], object], rounds: int) -> tuple[float, float, float]:
    """Time two functions in turn; return both medians and the median ratio, pair by pair."""
    a, b = [], []
    for _ in range(rounds):
        start = time.perf_counter()
        ours()
        middle = time.perf_counter()
        theirs()
        a.append(middle - start)
        b.append(time.perf_counter() - middle)
    ratio = statistics.median(y / x for x, y in zip(a, b, strict=True))
    return statistics.median(a), statistics.median(b), ratio


def main() -> None:
    """Print time and accuracy side by side."""
    gains = -np.geomspace(0.05, 2.0, 2000)
    print("\nsolving, one process            pretouch        SciPy    ratio   difference")
    for name, sensor in SENSORS.items():
        pt.find_contact(SCENARIO, sensor, gains)
        ours, theirs, ratio = measure(
            lambda s=sensor: pt.find_contact(SCENARIO, s, -0.7), lambda s=sensor: scipy_contact(s, -0.7), 20
        )
        time_of_contact = pt.find_contact(SCENARIO, sensor, -0.7).contact.time
        off = abs(scipy_contact(sensor, -0.7)[0] / time_of_contact - 1)
        print(f"{name + ', one contact':30s} {ours * 1e6:7.1f} us {theirs * 1e6:9.1f} us {ratio:7.1f}x  t: {off:.0e}")
        start = time.perf_counter()
        pt.find_contact(SCENARIO, sensor, gains)
        each = (time.perf_counter() - start) / len(gains)
        print(f"{name + ', each of 2,000':30s} {each * 1e6:7.1f} us {theirs * 1e6:9.1f} us {theirs / each:7.1f}x")
        ours, theirs, ratio = measure(
            lambda s=sensor: pt.design(pt.Task(SCENARIO, s, OBJECTIVE, bounds=(-10.0, -0.01))),
            lambda s=sensor: scipy_design(s),
            3,
        )
        gain = pt.design(pt.Task(SCENARIO, sensor, OBJECTIVE, bounds=(-10.0, -0.01))).gain
        off = abs(scipy_design(sensor) / gain - 1)
        print(f"{name + ', one design':30s} {ours * 1e3:7.1f} ms {theirs * 1e3:9.1f} ms {ratio:7.1f}x  D_p: {off:.0e}")


if __name__ == "__main__":
    main()
