"""Compare the virtual drag with optimized control laws on one noisy sampled loop, and with physical bounds.

Run with `python -m benchmarks.policies`; `--spread` changes the range of the detection distance, `--quick` runs few
encounters of some laws with one criterion. What is compared:

Each encounter has an object of constant speed v, a reflectance and a detection distance l_d, drawn at random. A law has
in encounter i the ratio r_i of contact speed to v, and the excursion E_i of the robot at contact. A criterion S reduces
the values of all encounters to one number: the mean, or the 95 % quantile. The numbers of every family minimize S(r)
while S(E) is at most that of the drag, on encounters for training. The result on other encounters is

    S(r) of the law / S(r) of the drag,

where each law is first scaled so that both have the same S(E). The standard error is that over groups of encounters.

The bounds hold for every law that starts from rest, also one that knows everything before the encounter. A law with the
largest acceleration A and the contact speed w satisfies in each encounter

    A >= (v^2 - w^2)/(2 l_d),      E >= (v - w)^2/(2 A).

The first bound follows from l'' <= A over the distance, the second from the speed v - w of the robot at contact. The
constant deceleration from detection to contact reaches the first bound. Its excursion is l_d (v - w)/(v + w).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from .laws import Ranging, ScaledDrag, constant, level, memory, rate, rise
from .loop import RATIO, START, Array, Encounters, Law, Outcome, draw_encounters, simulate
from .search import minimize

SEED = 20261124
SPREAD = 2**0.5  # of the detection distance, each way


class Size(NamedTuple):
    """Encounters for training, groups of tested encounters, encounters in a group, generations per number."""

    training: int
    groups: int
    tested: int
    generations: int


FULL, QUICK = Size(200, 4, 1000, 12), Size(20, 2, 20, 1)
PENALTY = 3.0  # for ln S(E) above that of the drag; along drags, ln S(r) falls by about as much as ln S(E) rises
PUSH = 0.5  # m/s^2, of accelerating objects
DRAG = ScaledDrag(constant)
Summary = Callable[[Array], Array]


class Family(NamedTuple):
    """A family of laws: name, law, first numbers, and the numbers that are not searched but fixed."""

    name: str
    law: Law
    start: tuple[float, ...]
    fixed: bool = False


FAMILIES = (
    Family("rate s' only", ScaledDrag(rate), (0, 0, 0)),
    Family("rise of ln xi since detection", ScaledDrag(rise), (0, 0, 0, 0)),
    Family("s', rise and time since detection", ScaledDrag(memory), (0,) * 9),
    Family("absolute level, q = 0.175", ScaledDrag(level), (0, 0.175), fixed=True),
    Family("absolute level, any q", ScaledDrag(level), (0, 0.1)),
    Family("self-ranging, floor 0.9 of the drag", Ranging(0.9), (0.2, 0.1, 1.0, -1.6)),
    Family("self-ranging, floor 0.5 of the drag", Ranging(0.5), (0.2, 0.1, 1.0, -1.6)),
)
CRITERIA: dict[str, Summary] = {
    "mean": lambda values: values.mean(axis=-1),
    "95 % quantile": lambda values: np.quantile(values, 0.95, axis=-1),
}


def outcome(law: Law, theta: Array, encounters: Encounters) -> Outcome:
    """Return the results of one law, arrays of shape (n,)."""
    return Outcome(*(values[0] for values in simulate(law, theta[None], encounters)))


def optimize(family: Family, summary: Summary, encounters: Encounters, generations: int) -> Array:
    """Return the numbers of the family that minimize the criterion on these encounters."""
    start = np.array(family.start, dtype=float)
    if family.fixed:
        return start
    allowed = summary(outcome(DRAG, np.zeros(1), encounters).excursion)

    def loss(theta: Array) -> Array:
        found = simulate(family.law, theta, encounters)
        beyond = np.maximum(0.0, np.log(summary(found.excursion) / allowed))
        return np.log(summary(found.ratio) + 1e-3) + PENALTY * beyond

    return minimize(loss, start, 0.2, generations * len(start), np.random.default_rng(SEED))


def scale(law: Law, theta: Array, encounters: Encounters, summary: Summary, excursion: float) -> Array:
    """Return the numbers with another first one, so that the law has this excursion [m]."""

    def beyond(first: float) -> float:
        return float(np.log(summary(outcome(law, np.r_[first, theta[1:]], encounters).excursion) / excursion))

    return np.r_[brentq(beyond, theta[0] - 2.0, theta[0] + 2.0, xtol=1e-4), theta[1:]]


class Compared(NamedTuple):
    """Results of a law relative to the drag; means over the groups.

    Args:
        mean: mean ratio of contact speed to approach speed.
        quantile: its 95 % quantile.
        worst: its largest value.
        excursion: 95 % quantile of the excursion.
        acceleration: mean of the largest acceleration over v^2.
        pushed: mean contact speed of objects that accelerate by PUSH.
    """

    mean: float
    quantile: float
    worst: float
    excursion: float
    acceleration: float
    pushed: float


def figures(law: Law, theta: Array, encounters: Encounters) -> Array:
    """Return the quantities of `Compared` in SI units, not relative to the drag."""
    found = outcome(law, theta, encounters)
    pushed = outcome(law, theta, encounters._replace(push=np.full_like(encounters.speed, PUSH)))
    contact, excursion = found.ratio, found.excursion
    sharp, fast = found.acceleration / encounters.speed**2, pushed.ratio * encounters.speed
    tail = CRITERIA["95 % quantile"]
    return np.array([contact.mean(), tail(contact), contact.max(), tail(excursion), sharp.mean(), fast.mean()])


def compare(law: Law, theta: Array, summary: Summary, groups: list[Encounters]) -> tuple[Compared, Compared]:
    """Compare a law with the drag of the same excursion on groups of encounters; return means and standard errors."""
    rows = []
    for encounters in groups:
        allowed = float(summary(outcome(DRAG, np.zeros(1), encounters).excursion))
        scaled = scale(law, theta, encounters, summary, allowed)
        rows.append(figures(law, scaled, encounters) / figures(DRAG, np.zeros(1), encounters))
    errors = np.std(rows, axis=0, ddof=1) / np.sqrt(len(rows))
    return Compared(*np.mean(rows, axis=0)), Compared(*errors)


def margin(found: Outcome, encounters: Encounters) -> float:
    """Return the smallest ratio to the two physical bounds; below 1 a bound is violated."""
    v, w = encounters.speed, encounters.speed * found.ratio
    first = found.acceleration * 2 * encounters.distance / (v**2 - w**2)
    second = found.excursion * 2 * found.acceleration / (v - w) ** 2
    return float(min(first.min(), second.min()))


class Informed(NamedTuple):
    """Laws that know everything, at the contact speed of the drag and relative to the drag; means over encounters.

    Args:
        excursion: of the constant deceleration from detection to contact.
        acceleration: of the constant deceleration, which no other law undercuts.
        least: smallest excursion with the largest acceleration of the drag.
    """

    excursion: float
    acceleration: float
    least: float


def informed(drag: Outcome, encounters: Encounters) -> Informed:
    """Compare the drag with laws that know everything before the encounter."""
    v, l_d, r = encounters.speed, encounters.distance, drag.ratio
    retreat, deceleration = l_d * (1 - r) / (1 + r), (1 - r**2) / (2 * l_d)
    least = (v * (1 - r)) ** 2 / (2 * drag.acceleration)
    excursion, acceleration = drag.excursion.mean(), np.mean(drag.acceleration / v**2)
    return Informed(retreat.mean() / excursion, deceleration.mean() / acceleration, least.mean() / excursion)


def print_drag(groups: list[Encounters], spread: float) -> None:
    """Print the results of the drag and of laws that know everything."""
    drag = [outcome(DRAG, np.zeros(1), each) for each in groups]
    excursion, ratio = np.mean([each.excursion for each in drag]), np.mean([each.ratio for each in drag])
    known = Informed(*np.mean([informed(each, group) for each, group in zip(drag, groups, strict=True)], axis=0))
    print(f"drag, ratio {RATIO:g} on an ideal loop, objects detected within {spread:.3g} times {1e3 * START:g} mm:")
    print(f"mean excursion {1e3 * excursion:.1f} mm, mean ratio of contact speed to approach speed {ratio:.3f}")
    print("a law that knows everything, at the contact speeds of the drag; drag = 1:")
    print(f"  constant deceleration: excursion {known.excursion:.3f}, acceleration {known.acceleration:.3f}")
    print(f"  physical bound with the largest acceleration of the drag: excursion {known.least:.3f}")


def main() -> None:
    """Print all results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.policies", description=__doc__.splitlines()[0])
    parser.add_argument("--spread", type=float, default=SPREAD, help="largest detection distance over 42.2 mm")
    parser.add_argument("--quick", action="store_true", help="few encounters, a third of the laws, one criterion")
    options = parser.parse_args()
    size = QUICK if options.quick else FULL
    rng = np.random.default_rng(SEED)
    training = draw_encounters(rng, size.training, options.spread)
    groups = [draw_encounters(rng, size.tested, options.spread) for _ in range(size.groups)]
    print_drag(groups, options.spread)
    criteria, families = (list(CRITERIA.items())[:1], FAMILIES[::3]) if options.quick else (CRITERIA.items(), FAMILIES)
    for name, summary in criteria:
        print(f"\nsmallest {name} of the contact speed at the same {name} of the excursion, contact speeds; drag = 1")
        columns = ("mean", "95 %", "worst", "95 % exc.", "accel.", "pushed")
        print(f"{'':36}" + "".join(f"{column:>16}" for column in columns))
        for family in families:
            theta = optimize(family, summary, training, size.generations)
            cells = zip(*compare(family.law, theta, summary, groups), strict=True)
            print(f"{family.name:36}" + "".join(f"{value:8.3f} +- {error:.3f}" for value, error in cells), flush=True)


if __name__ == "__main__":
    main()
