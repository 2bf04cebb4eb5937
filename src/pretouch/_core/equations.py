"""List the equations of the paper that pretouch implements.

The short paper on this design method is called the letter. The code cites its equations as L(1) to L(23). A function
or class that implements an equation cites its id in the first two paragraphs of its docstring. A test that checks the
equation independently has the marker `equation`. tests/contract/test_equation_ids.py fails if either is missing.
"""

from __future__ import annotations

from typing import Final

EQUATIONS: Final[dict[str, str]] = {
    "L(1)": "virtual admittance: M_a (x'' - x_d'') + D_a (x' - x_d') + K_a (x - x_d) = F_p",
    "L(2)": "virtual force: F_p = D_p xi'/xi",
    "L(3)": "inverse power curve: xi = alpha beta psi / (l + l_0)^n",
    "L(4)": "motion with the inverse power curve",
    "L(5)": "first-order exponential curve: xi = a_1 exp(c_1 l)",
    "L(6)": "second-order exponential curve: xi = a_2 exp(b_2 l^2 + c_2 l)",
    "L(7)": "motion with the first-order exponential curve",
    "L(8)": "motion with the first-order exponential curve, in the distance l",
    "L(9)": "obstacle in uniform acceleration relative to the reference",
    "L(10)": "closed form of l(t) for L(8)",
    "L(11)": "X_1 of L(10)",
    "L(12)": "X_2 of L(10)",
    "L(13)": "lambda_1, lambda_2 of L(10)",
    "L(14)": "motion with the second-order exponential curve",
    "L(15)": "motion with the second-order exponential curve, in the distance l, for an obstacle in uniform motion",
    "L(16)": "uniform motion l = A t + B",
    "L(17)": "A of L(16)",
    "L(18)": "B of L(16)",
    "L(19)": "plant position of the uniform motion over the distance",
    "L(20)": "objective f_1: weighs the excursion against the relative velocity",
    "L(21)": "evaluation of f_1 at contact, l = 0",
    "L(22)": "objective f_2: weighs the time against the relative velocity",
    "L(23)": "evaluation of f_2 at contact, l = 0",
}
"""Short descriptions of the letter's numbered equations, by their ids."""
