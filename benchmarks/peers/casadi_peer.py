"""CasADi: IPOPT and its SQP method on the closed form and on a collocation of the motion; CVODES for contacts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from . import closed_form
from .protocol import Job, Way, missing, one_by_one
from .work import BOUNDS, DAMPING, DISTANCE, EXPONENT, MASS, OFFSET, STIFFNESS, Column, first_guess, latest

_INTERVALS = 12
_DEGREE = 6
_OPTIONS = {
    "ipopt": {"ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-11, "print_time": False},
    "sqpmethod": {
        "qpsol": "qrqp",
        "qpsol_options": {"print_iter": False, "print_header": False, "error_on_fail": False},
        "print_iteration": False,
        "print_header": False,
        "print_status": False,
        "print_time": False,
        "tol_pr": 1e-10,
        "tol_du": 1e-10,
    },
}


class CasADi:
    """Symbolic expressions with exact derivatives, run on its virtual machine."""

    name = "CasADi"

    def available(self) -> str:
        """Return an empty reason where CasADi is installed."""
        return missing("casadi")

    def cases(self) -> Sequence[Way]:
        """Return its ways."""
        exponential, power = partial(Way, sensor="exponential-1"), partial(Way, sensor="inverse-power")
        return (
            exponential(
                name="SX map, closed form, two evaluations", cases="B", make=_mapped, tolerance=1e-10, grows=True
            ),
            exponential(
                name="sqpmethod, closed form", cases="ACD", make=partial(_closed, "sqpmethod"), tolerance=1e-7, size=500
            ),
            exponential(
                name="sqpmethod, closed form, limits",
                cases="E",
                make=partial(_closed, "sqpmethod", limited=True),
                tolerance=1e-7,
                size=500,
            ),
            exponential(
                name="IPOPT, closed form", cases="AC", make=partial(_closed, "ipopt"), tolerance=1e-7, size=100
            ),
            power(name="CVODES over distance", cases="B", make=_cvodes, tolerance=1e-8, size=500),
            power(name="IPOPT, collocation", cases="ACD", make=partial(_collocated, "ipopt"), tolerance=1e-7, size=20),
            power(name="sqpmethod, collocation", cases="A", make=partial(_collocated, "sqpmethod"), tolerance=1e-7),
        )


def _mapped(v: Column, gain: Column) -> Job:
    import casadi as ca  # noqa: PLC0415

    speed, strength = ca.SX.sym("v"), ca.SX.sym("gain")
    solve = ca.Function("contact", [speed, strength], [closed_form.solve(ca, speed, strength)]).map(len(v))
    buffer, run = solve.buffer()
    inputs, out = (np.ascontiguousarray(v), np.ascontiguousarray(gain)), np.empty(len(v))
    for i, column in enumerate(inputs):
        buffer.set_arg(i, memoryview(column))
    buffer.set_res(0, memoryview(out))

    def job(_owner: Any = (solve, buffer)) -> Column:  # which must outlive the call
        run()
        return out

    return job


def _closed(solver: str, v: Column, limited: bool = False) -> Job:
    """Build a program with unknowns D_p and t, the equality l(t, D_p) = 0, and the parameter v."""
    import casadi as ca  # noqa: PLC0415

    gain, t, speed = ca.SX.sym("gain"), ca.SX.sym("t"), ca.SX.sym("v")
    level, rate, _, _ = closed_form.distance(ca, t, speed, gain)
    problem = {"x": ca.vertcat(gain, t), "p": speed, "f": closed_form.merit(t, speed, rate), "g": level}
    optimize = ca.nlpsol("design", solver, problem, _OPTIONS[solver])

    def solve(velocity: float) -> float:
        guess = -math.exp(first_guess("exponential-1", -velocity))
        begin = [guess, closed_form.start(math, velocity, guess)]
        last = latest(velocity) if limited else ca.inf
        found = optimize(x0=begin, p=velocity, lbg=0, ubg=0, lbx=[BOUNDS[0], 0], ubx=[BOUNDS[1], last])
        return float(found["x"][0])

    return one_by_one(solve, v)


def _motion(ca: Any) -> Any:
    """Return (t, q)' over s = 1 - l / l(0), with q = -l', as a function of s, (t, q), v and D_p."""
    s, y, v, gain = ca.SX.sym("s"), ca.SX.sym("y", 2), ca.SX.sym("v"), ca.SX.sym("gain")
    distance = DISTANCE * (1 - s)
    force = -DAMPING * (v + y[1]) - STIFFNESS * (DISTANCE + v * y[0] - distance)
    pull = gain * EXPONENT / (distance + OFFSET)
    slope = ca.vertcat(DISTANCE / y[1], DISTANCE / MASS * (force / y[1] + pull))
    return ca.Function("motion", [s, y, v, gain], [slope])


def _cvodes(v: Column, gain: Column) -> Job:
    import casadi as ca  # noqa: PLC0415

    s, y, p = ca.SX.sym("s"), ca.SX.sym("y", 2), ca.SX.sym("p", 2)
    system = {"x": y, "t": s, "p": p, "ode": _motion(ca)(s, y, p[0], p[1])}
    options = {"reltol": 1e-12, "abstol": 1e-14, "max_num_steps": 100_000}
    integrate = ca.integrator("contact", "cvodes", system, 0.0, 1.0, options)
    return one_by_one(lambda v, gain: float(integrate(x0=[0.0, -v], p=[v, gain])["xf"][0]), v, gain)


def _collocated(solver: str, v: Column) -> Job:
    """Build a program with the motion as collocation at Gauss-Radau points on equal intervals of the distance."""
    import casadi as ca  # noqa: PLC0415

    gain, speed, motion = ca.MX.sym("gain"), ca.MX.sym("v"), _motion(ca)
    points = [0.0, *ca.collocation_points(_DEGREE, "radau")]
    to_slope = np.array(ca.collocation_coeff(points[1:])[0])
    width = 1 / _INTERVALS
    unknowns, equations, here = [gain], [], ca.vertcat(0, -speed)
    for k in range(_INTERVALS):
        inner = ca.MX.sym(f"y{k}", 2, _DEGREE)
        unknowns.append(ca.vec(inner))
        at = [width * (k + tau) for tau in points[1:]]
        slopes = ca.horzcat(*(motion(at[j], inner[:, j], speed, gain) for j in range(_DEGREE)))
        equations.append(ca.vec(ca.horzcat(here, inner) @ to_slope - width * slopes))
        here = inner[:, -1]
    value = closed_form.merit(here[0], speed, here[1])
    problem = {"x": ca.vertcat(*unknowns), "p": speed, "f": value, "g": ca.vertcat(*equations)}
    optimize = ca.nlpsol("design", solver, problem, _OPTIONS[solver])
    grid = np.concatenate([width * (k + np.array(points[1:])) for k in range(_INTERVALS)])

    def solve(velocity: float) -> float:
        guess = -math.exp(first_guess("inverse-power", -velocity))
        q = -velocity * (1 - 0.7 * grid)
        t = DISTANCE / -velocity / 0.7 * -np.log(1 - 0.7 * grid)
        begin = np.concatenate([[guess], np.stack([t, q], axis=1).ravel()])
        low, high = np.full(len(begin), 0.0), np.full(len(begin), np.inf)
        low[0], high[0], low[2::2] = *BOUNDS, 1e-4
        found = optimize(x0=begin, p=velocity, lbg=0, ubg=0, lbx=low, ubx=high)
        return float(found["x"][0])

    return one_by_one(solve, v)
