"""Solve many approaches under the virtual drag by the compiled solver.

The solver integrates over the distance.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from pretouch._core.numbers import FloatArray, IntArray
from pretouch._core.values import Picklable

from .curve import Curves
from .kernels import ValuesAtNodes, drag_approaches
from .layout import DRAG_NODES, DRAG_PEAKS, DRAG_ROWS
from .parallel import run_in_chunks

_LEAST: Final = 512  # approaches that are worth a thread
_MOST: Final = 1 << 13  # approaches per call of the solver, so that an interrupt takes effect


class DragPath(Picklable):
    """Solved approaches under the virtual drag.

    They provide final states, peaks, derivatives, impulse balance and samples.

    Args:
        inputs: see `drag_approaches`.
        curves: the curves.
        horizon: longest time [s].

    Attributes:
        rows: columns DRAG_ROWS of all approaches, by name.
        status: how each approach ended, as the integer value of ContactStatus.
    """

    __slots__ = ("_cells", "_curves", "_horizon", "_inputs", "_peaks", "rows", "status")

    def __init__(self, inputs: tuple[FloatArray, ...], curves: Curves, horizon: float) -> None:
        self._inputs, self._curves, self._horizon = inputs, curves, horizon
        self._peaks: dict[str, FloatArray] | None = None
        self.status: IntArray
        self.rows, self.status, self._cells = self._solve()

    def _solve(
        self, course: tuple[FloatArray, FloatArray] | None = None, **outputs: Any
    ) -> tuple[dict[str, FloatArray], IntArray, IntArray]:
        """Call the compiled drag solver for all approaches, with optional output arrays."""
        count = len(self._inputs[0])
        rows, status, cells = np.empty((count, len(DRAG_ROWS))), np.empty(count, np.int64), np.empty(count, np.int64)
        windows, starts, curve_of = self._curves
        at_nodes = outputs.pop("at_nodes", None)

        def run(start: int, stop: int) -> None:
            part = slice(start, stop)
            nodes = None if at_nodes is None else at_nodes._replace(first=at_nodes.first[part])
            drag_approaches(
                [column[part] for column in self._inputs],
                (windows, starts, curve_of if len(curve_of) == 1 else curve_of[part]),
                self._horizon,
                rows[part],
                status[part],
                cells[part],
                at_nodes=nodes,
                course=None if course is None else (course[0][part], course[1][part]),
                **{name: array[part] for name, array in outputs.items()},
            )

        run_in_chunks(run, count, least=_LEAST, most=_MOST)
        return dict(zip(DRAG_ROWS, rows.T, strict=True)), status, cells

    @property
    def peaks(self) -> dict[str, FloatArray]:
        """The robot's largest and smallest acceleration, velocity and travel.

        The keys are the names in DRAG_PEAKS.
        """
        if self._peaks is None:
            peaks = np.empty((len(self.status), len(DRAG_PEAKS)))
            self._solve(peaks=peaks)
            self._peaks = dict(zip(DRAG_PEAKS, peaks.T, strict=True))
        return self._peaks

    def derivatives(self, change: Callable[[FloatArray, IntArray], FloatArray] | None = None) -> FloatArray:
        """Differentiate squared speed and time at the end of each approach.

        Args:
            change: function from distances [m] and the indices of their approaches, shape (m, nodes) and (m,), to the
                derivative of g by the parameter.

        Returns:
            The derivatives of l'^2 and t by k, a_o, the initial l and l'^2, and the parameter, shape (n, 2, 5).
        """
        gradients = np.empty((len(self.status), 2, 5))
        more: dict[str, Any] = {} if change is None else {"at_nodes": self._at_nodes("changes", change)}
        self._solve(gradients=gradients, **more)
        return gradients

    def balance(self, log_output: Callable[[FloatArray, IntArray], FloatArray]) -> FloatArray:
        """Return the velocity change [m/s] by the drag in each approach.

        The second column is the moment of this change over time [m]. The columns are k int s' ds and its moment, shape
        (n, 2). `log_output` has the arguments of `change` above.
        """
        balance = np.empty((len(self.status), 2))
        self._solve(balance=balance, at_nodes=self._at_nodes("log_outputs", log_output))
        return balance

    def sample(self, times: FloatArray, trace: FloatArray) -> None:
        """Sample distance [m] and speed [m/s] of each approach.

        The samples are written to `trace`, at those `times` [s] that lie within an approach. The times ascend; `trace`
        has the shape (n, m, 2).
        """
        self._solve((times, trace))

    def _at_nodes(self, name: str, function: Callable[[FloatArray, IntArray], FloatArray]) -> ValuesAtNodes:
        """Evaluate a function of the distance at all quadrature nodes."""
        first = np.cumsum(self._cells) - self._cells
        nodes = np.empty((int(self._cells.sum()), DRAG_NODES))
        self._solve(at_nodes=ValuesAtNodes(first, nodes=nodes))
        values = function(nodes, np.repeat(np.arange(len(first)), self._cells))
        return ValuesAtNodes(first, **{name: np.ascontiguousarray(values, dtype=np.float64)})
