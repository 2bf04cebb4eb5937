"""What a scenario file comes to: everything that `design_gain` takes, and where it came from."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pretouch._core.errors import InvalidInputError, ScenarioFileError
from pretouch.design.constraints import Constraint
from pretouch.design.impact import ImpactModel
from pretouch.design.objectives import Objective
from pretouch.motion.scenario import Scenario
from pretouch.sensors import SensorModel

from .document import Mistake, listed
from .placing import place
from .positions import key_lines
from .robust import RobustRequest

if TYPE_CHECKING:
    import xarray as xr

    from pretouch.calibration import CalibrationReport
    from pretouch.design.admittance_result import AdmittanceDesign
    from pretouch.design.front import ParetoFront
    from pretouch.design.result import GainDesign
    from pretouch.design.robust.result import RobustDesign
    from pretouch.sweep import Axes

__all__ = ["DEFAULT_QUANTITIES", "DesignProblem", "ScenarioSource"]

DEFAULT_QUANTITIES: Final = ("displacement", "relative_velocity")
"""What is traded where a file names nothing: L(20)'s two."""

NOTHING_UNCERTAIN: Final = (
    "found no section [uncertainty], expected what is known of inputs, such as "
    'obstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }'
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioSource:
    """The file that a problem was read from.

    Args:
        path: where it stood.
        text: its text, so that a report can show it.
        sha256: the hash of its bytes, in hexadecimal.
    """

    path: Path
    text: str = field(repr=False)
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignProblem:
    """A scenario file, read: the encounter, the sensor, and what is asked for.

    Args:
        scenario: the encounter.
        sensor: the sensor curve, over the distance from the contact surface.
        objective: what is minimized.
        bounds: the gains D_p between which the optimum is sought [N s].
        constraints: the limits.
        impact: the physical properties, where given.
        method: how encounters are solved.
        horizon: the longest time that an encounter is followed [s].
        natural_frequency_bounds: where the natural frequency is free [rad/s].
        damping_ratio_bounds: where the damping ratio is free.
        quantities: what `trade_off` trades.
        choice: the gain that it marks [N s]; None for the one that is designed.
        robust: what is known of inputs that are uncertain, and what is asked of a robust gain.
        calibration: the report of the fit, where the sensor was fitted on the fly.
        source: the file.
    """

    scenario: Scenario
    sensor: SensorModel
    objective: Objective
    bounds: tuple[float, float]
    constraints: tuple[Constraint, ...]
    impact: ImpactModel | None
    method: str
    horizon: float
    natural_frequency_bounds: tuple[float, float] | None
    damping_ratio_bounds: tuple[float, float] | None
    quantities: tuple[str, ...]
    choice: float | None
    robust: RobustRequest
    calibration: CalibrationReport | None
    source: ScenarioSource

    @property
    def is_admittance_free(self) -> bool:
        """Whether the file leaves natural frequency or damping ratio open."""
        return self.natural_frequency_bounds is not None or self.damping_ratio_bounds is not None

    def design(self) -> GainDesign:
        """Choose the gain, with the admittance as it is.

        Returns:
            The design; where no gain will do, its status says so.

        Raises:
            ScenarioFileError: the file asks for something that makes no sense.
        """
        from pretouch.design import design_gain  # noqa: PLC0415 - the compiled kernels, only when needed

        try:
            return design_gain(self.scenario, self.sensor, self.objective, **self._shared())
        except InvalidInputError as error:
            raise ScenarioFileError(self._placed(str(error))) from error

    def design_admittance(self) -> AdmittanceDesign:
        """Choose the gain together with what the file leaves open of the admittance.

        Returns:
            The design; where nothing will do, its status says so.

        Raises:
            ScenarioFileError: the file leaves nothing open, or asks for something that makes no sense.
        """
        from pretouch.design import design_admittance  # noqa: PLC0415 - the compiled kernels, only when needed

        try:
            return design_admittance(self.scenario, self.sensor, self.objective, **self._free(), **self._shared())
        except InvalidInputError as error:
            raise ScenarioFileError(self._placed(str(error))) from error

    def trade_off(self) -> ParetoFront:
        """Find the Pareto front of the quantities that the file names.

        Returns:
            The front, with the choice of the file marked, or with the gain that is optimal for the admittance as it is.

        Raises:
            ScenarioFileError: the file asks for something that makes no sense.
        """
        from pretouch.design import pareto_front  # noqa: PLC0415 - the compiled kernels, only when needed

        choice = self.design() if self.choice is None else self.choice
        try:
            return pareto_front(
                self.scenario, self.sensor, self.quantities, choice=choice, **self._free(), **self._shared()
            )
        except InvalidInputError as error:
            raise ScenarioFileError(self._placed(str(error))) from error

    def sweep(self, axes: Axes, *, gain: float | None = None, **options: Any) -> xr.Dataset:
        """Compute this problem over a grid of inputs, as `pretouch.sweep` does.

        Args:
            axes: inputs and their values.
            gain: D_p [N s] of all encounters; where it is neither given nor an axis, each encounter is designed.
            options: what else `pretouch.sweep` takes.

        Returns:
            The dataset.
        """
        from pretouch.sweep import sweep  # noqa: PLC0415

        asked: dict[str, Any] = {"gain": gain}
        if gain is None and "gain" not in axes:
            asked = {"objective": self.objective, "bounds": self.bounds, "constraints": self.constraints}
        held: dict[str, Any] = {"impact": self.impact, "method": self.method, "horizon": self.horizon}
        return sweep(self.scenario, self.sensor, axes, **asked, **held, **options)

    def design_robust(self, *, samples: int | None = None, seed: int | None = None) -> RobustDesign:
        """Choose the gain for inputs that are not known exactly.

        Args:
            samples: how many encounters the measure is taken over, and as many fresh ones; None as in the file.
            seed: of all samples; None as in the file.

        Returns:
            The design; where no gain will do, its status says so.

        Raises:
            ScenarioFileError: the file does not say what is uncertain, or asks for something that makes no sense.
        """
        from pretouch.design.robust import design_robust_gain  # noqa: PLC0415 - the compiled kernels, only when needed

        asked = self.robust
        if not asked.uncertainty:
            raise ScenarioFileError(f"{self.source.path}: {NOTHING_UNCERTAIN}")
        try:
            return design_robust_gain(
                self.scenario,
                self.sensor,
                self.objective,
                bounds=self.bounds,
                uncertainty=asked.uncertainty,
                measure=asked.measure,
                constraints=asked.constraints,
                impact=self.impact,
                samples=asked.samples if samples is None else samples,
                validation=asked.validation if samples is None else samples,
                seed=asked.seed if seed is None else seed,
                confidence=asked.confidence,
                sampling=asked.sampling,
                method=self.method,
                horizon=self.horizon,
            )
        except InvalidInputError as error:
            raise ScenarioFileError(self._placed(str(error))) from error

    def _shared(self) -> dict[str, Any]:
        """Return what every verb takes."""
        names = ("bounds", "constraints", "impact", "method", "horizon")
        return {name: getattr(self, name) for name in names}

    def _free(self) -> dict[str, Any]:
        return {
            "natural_frequency": self.natural_frequency_bounds,
            "damping_ratio": self.damping_ratio_bounds,
        }

    def _placed(self, message: str) -> str:
        """Put the line and the key before a message, as near as they are known."""
        lines = key_lines(self.source.text)
        path, sentence = place(message, "")
        known = next((path[:n] for n in range(len(path), 0, -1) if path[:n] in lines), None)
        if known is None:
            return f"{self.source.path}: {message}"
        return listed(self.source.path, [Mistake(line=lines[known], key=".".join(map(str, path)), sentence=sentence)])
