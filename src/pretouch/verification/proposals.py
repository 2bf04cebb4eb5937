"""What a verdict finds of other gains and other loops: each a value with its units."""

from __future__ import annotations

from dataclasses import dataclass

from pretouch._core.numbers import FloatArray
from pretouch._core.values import Value

__all__ = ["Change", "LoopCurve", "Loss"]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LoopCurve(Value):
    """The gains that were tried on the loop.

    Args:
        gain: D_p [N s], ascending, shape (n,).
        objective: its mean over the runs; infinite where a run ends without contact.
        standing: the least share of runs in which a limit holds beside the share required, at most 1; less where
            contact is harder than without mitigation.
        share: the share of runs in which all limits hold at once.
        runs: how many runs of each.
    """

    gain: FloatArray
    objective: FloatArray
    standing: FloatArray
    share: FloatArray
    runs: int

    def __repr__(self) -> str:
        if not len(self.gain):
            return "<LoopCurve: no gain>"
        return f"<LoopCurve: {len(self.gain)} gains from {self.gain[0]:g} to {self.gain[-1]:g} N s, {self.runs} runs>"


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss(Value):
    """What the gain costs beside the best one for this loop.

    Args:
        predicted: the objective of the nominal encounter in continuous time; None without contact.
        objective: its mean over the runs; None where a run ends without contact.
        standard_error: of that mean.
        loop_gain: the best gain on the loop that keeps the limits [N s]; None where none that was tried does.
        sought_margin: to instability, which the best gain was sought with: 2; 1 where no gain within the bounds has
            that; None where the margin is not known.
        loop_objective: the mean objective with that gain, over the same runs.
        loss: mean of objective - objective with the loop gain, run by run.
        loss_error: standard error of that mean.
        curve: the gains that were tried.
    """

    predicted: float | None
    objective: float | None
    standard_error: float | None
    loop_gain: float | None
    sought_margin: float | None
    loop_objective: float | None
    loss: float | None
    loss_error: float | None
    curve: LoopCurve


@dataclass(frozen=True, slots=True, kw_only=True)
class Change(Value):
    """One change of the loop or the gain, as it was simulated.

    Args:
        name: short name, such as `sensor-rate`.
        sentence: what to do, with numbers.
        gain: D_p with which it was run [N s].
        objective: the mean objective with it; None where a run ends without contact.
        improvement: by how much the objective falls, as a share of what it was; None where either is not known.
        improvement_error: standard error of that.
        standing: the least share of runs in which a limit holds beside the share required, with it; at most 1, less
            where contact is harder than without mitigation or the loop unstable.
        held: the share of runs with it in which the limit holds that was missed most; None where none was missed.
        margin: to instability with it; None where that is not known.
        helps: whether it gains more than chance can, and leaves the loop stable.
    """

    name: str
    sentence: str
    gain: float
    objective: float | None
    improvement: float | None
    improvement_error: float | None
    standing: float
    held: float | None
    margin: float | None
    helps: bool
