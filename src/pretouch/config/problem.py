"""What a scenario file comes to: everything that `design_gain` takes, and where it came from."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pretouch._core.errors import InvalidInputError, ScenarioFileError
from pretouch.design.constraints import Constraint
from pretouch.design.impact import ImpactModel
from pretouch.design.objectives import Objective
from pretouch.motion.scenario import Scenario
from pretouch.sensors import SensorModel

from .document import Mistake, listed
from .placing import place
from .positions import key_lines

if TYPE_CHECKING:
    import xarray as xr

    from pretouch.calibration import CalibrationReport
    from pretouch.design.result import GainDesign
    from pretouch.sweep import Axes

__all__ = ["DesignProblem", "ScenarioSource"]


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
    calibration: CalibrationReport | None
    source: ScenarioSource

    def design(self) -> GainDesign:
        """Choose the gain.

        Returns:
            The design; where no gain will do, its status says so.

        Raises:
            ScenarioFileError: the file asks for something that makes no sense.
        """
        from pretouch.design import design_gain  # noqa: PLC0415 - the compiled kernels, only when needed

        try:
            return design_gain(
                self.scenario,
                self.sensor,
                self.objective,
                bounds=self.bounds,
                constraints=self.constraints,
                impact=self.impact,
                method=self.method,
                horizon=self.horizon,
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

    def _placed(self, message: str) -> str:
        """Put the line and the key before a message, as near as they are known."""
        lines = key_lines(self.source.text)
        path, sentence = place(message, "")
        known = next((path[:n] for n in range(len(path), 0, -1) if path[:n] in lines), None)
        if known is None:
            return f"{self.source.path}: {message}"
        return listed(self.source.path, [Mistake(line=lines[known], key=".".join(map(str, path)), sentence=sentence)])
