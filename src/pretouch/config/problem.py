"""What a scenario file comes to: everything that `design_gain` takes, and where it came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from pretouch._core.errors import InvalidInputError, OutOfRangeError, ScenarioFileError
from pretouch.design.constraints import Constraint
from pretouch.design.impact import ImpactModel
from pretouch.design.objectives import Objective
from pretouch.motion.scenario import Scenario
from pretouch.sensors import SensorModel

from .requests import LoopRequest, RobustRequest
from .source import ScenarioSource

if TYPE_CHECKING:
    import xarray as xr

    from pretouch.calibration import CalibrationReport
    from pretouch.design.admittance_result import AdmittanceDesign
    from pretouch.design.front.result import ParetoFront
    from pretouch.design.result import GainDesign
    from pretouch.design.robust.result import RobustDesign
    from pretouch.simulation import GainLimit
    from pretouch.sweep import Axes
    from pretouch.uncertainty import Reservations
    from pretouch.verification import SimulatedEncounter, Verdict

__all__ = ["DesignProblem"]

NOTHING_UNCERTAIN: Final = (
    "found no section [uncertainty], expected what is known of inputs, such as "
    'obstacle.velocity = { uniform = ["-0.4 m/s", "-0.2 m/s"] }'
)

NO_LOOP: Final = (
    'found no sections [chain] and [controller], expected the sampled loop, such as [chain] with part = "VCNL4010" and '
    '[controller] with rate = "1 kHz"'
)
_MOVE_THE_LIMIT: Final = ("admittance.", "sensor.", "obstacle.position", "plant.position")


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
        loop: the sampled loop on which the gain is to run, where the file describes one.
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
    loop: LoopRequest | None
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

        with self.source.placing():
            return design_gain(self.scenario, self.sensor, self.objective, **self._shared())

    def design_admittance(self) -> AdmittanceDesign:
        """Choose the gain together with what the file leaves open of the admittance.

        Returns:
            The design; where nothing will do, its status says so.

        Raises:
            ScenarioFileError: the file leaves nothing open, or asks for something that makes no sense.
        """
        from pretouch.design import design_admittance  # noqa: PLC0415 - the compiled kernels, only when needed

        with self.source.placing():
            return design_admittance(self.scenario, self.sensor, self.objective, **self._free(), **self._shared())

    def trade_off(self) -> ParetoFront:
        """Find the Pareto front of the quantities that the file names.

        Returns:
            The front, with the choice of the file marked, or with the gain that is optimal for the admittance as it is.

        Raises:
            ScenarioFileError: the file asks for something that makes no sense.
        """
        from pretouch.design import pareto_front  # noqa: PLC0415 - the compiled kernels, only when needed

        choice = self.design() if self.choice is None else self.choice
        with self.source.placing():
            return pareto_front(
                self.scenario, self.sensor, self.quantities, choice=choice, **self._free(), **self._shared()
            )

    def sweep(self, axes: Axes, *, gain: float | None = None, **options: Any) -> xr.Dataset:
        """Compute this problem over a grid of inputs, as `pretouch.sweep` does.

        Args:
            axes: inputs and their values.
            gain: D_p [N s] of all encounters; where it is neither given nor an axis, each encounter is designed.
            options: what else `pretouch.sweep` takes.

        Returns:
            The dataset.

        Raises:
            ScenarioFileError: the file asks for a margin to instability, and an axis moves the limit.
            OutOfRangeError: an encounter starts outside the range of the sensor.
        """
        from pretouch.sweep import sweep  # noqa: PLC0415

        asked: dict[str, Any] = {"gain": gain}
        if gain is None and "gain" not in axes:
            with self.source.placing():
                asked = {
                    "objective": self.objective,
                    "bounds": self._bounds_over(axes),
                    "constraints": self.constraints,
                }
        held: dict[str, Any] = {"impact": self.impact, "method": self.method, "horizon": self.horizon}
        try:
            return sweep(self.scenario, self.sensor, axes, **asked, **held, **options)
        except OutOfRangeError as error:
            raise OutOfRangeError(self.source.explained(error)) from error

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
        with self.source.placing():
            return design_robust_gain(
                self.scenario,
                self.sensor,
                self.objective,
                bounds=self.stable_bounds(),
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

    def simulate_encounter(self, *, gain: float | None = None, seed: int | None = None) -> SimulatedEncounter:
        """Run the encounter once on the loop of the file.

        Args:
            gain: D_p [N s]; None for that of the file, and where it has none, for the designed one.
            seed: of the noise; None as in the file.

        Returns:
            The run, beside its prediction and beside the same run without mitigation.

        Raises:
            ScenarioFileError: the file describes no loop, or there is no gain to run it with.
        """
        from pretouch.verification import simulate_encounter  # noqa: PLC0415 - the compiled loop, only when needed

        asked = self._asked_loop()
        options: dict[str, Any] = {"impact": self.impact, "method": self.method, "horizon": self.horizon}
        with self.source.placing():
            chosen = self._gain_of(asked, gain)
            return simulate_encounter(self.scenario, self.sensor, asked.seeded(seed), chosen, **options)

    def verify(
        self, *, gain: float | None = None, runs: int | None = None, seed: int | None = None, changes: bool = True
    ) -> Verdict:
        """Find out whether the gain holds on the loop of the file, and what would help.

        Args:
            gain: D_p [N s]; None for that of the file, and where it has none, for the designed one.
            runs: how many encounters; None as in the file.
            seed: of encounters and noise; None as in the file.
            changes: whether to look for the best gain on the loop and for the change that helps most.

        Returns:
            The verdict.

        Raises:
            ScenarioFileError: the file describes no loop, or asks for something that makes no sense.
        """
        from pretouch.verification import verify_gain  # noqa: PLC0415 - the compiled loop, only when needed

        asked = self._asked_loop()
        with self.source.placing():
            return verify_gain(
                self.scenario,
                self.sensor,
                self.objective,
                asked.seeded(seed),
                bounds=self.stable_bounds(),
                gain=asked.gain if gain is None else gain,
                constraints=self.robust.constraints,
                impact=self.impact,
                uncertainty=self.robust.uncertainty,
                runs=asked.runs if runs is None else runs,
                confidence=self.robust.confidence,
                method=self.method,
                horizon=self.horizon,
                changes=changes,
                calibration=self.calibration,
            )

    def reservations(self, answer: Any = None) -> Reservations | None:
        """Tell what the calibration of the sensor leaves open of an answer to this problem.

        Args:
            answer: what one of the verbs returned; the problem itself where none is given.

        Returns:
            The reservations; None where the sensor is given by its parameters.
        """
        if self.calibration is None:
            return None
        from pretouch.uncertainty import reservations_of  # noqa: PLC0415 - the compiled kernels, only when needed

        return reservations_of(self.calibration, self if answer is None else answer)

    def _asked_loop(self) -> LoopRequest:
        if self.loop is None:
            raise ScenarioFileError(f"{self.source.path}: {NO_LOOP}")
        return self.loop

    def _gain_of(self, asked: LoopRequest, gain: float | None) -> float:
        """Return the gain to be run: the one that is named, that of the file, or the designed one."""
        named = asked.gain if gain is None else gain
        if named is not None:
            return named
        design = self.design()
        if design.gain is None:
            raise InvalidInputError(
                f"gain: the design is {design.status.value}, so there is none to simulate; name one, such as "
                'gain = "-0.7 N*s" in [controller] or --gain'
            )
        return float(design.gain)

    def stability_limit(self) -> GainLimit:
        """Find the strongest gain with which the sampled loop is stable at every distance of the encounter.

        Returns:
            The limit.

        Raises:
            ScenarioFileError: the file describes no loop.
        """
        return self._asked_loop().stability_limit(self.scenario, self.sensor)

    def stable_bounds(self) -> tuple[float, float]:
        """Return the bounds of the gain, cut where the file asks for a margin to instability.

        Returns:
            The gains D_p between which the optimum is sought [N s]: those of the file, where it asks for no margin.
        """
        return self.bounds if self.loop is None else self.loop.stable_bounds(self.bounds, self.scenario, self.sensor)

    def _bounds_over(self, axes: Axes) -> tuple[float, float]:
        """Return the bounds for a sweep; refuse axes for which one limit of stability does not hold."""
        names = [name for axis, values in axes.items() for name in (values if isinstance(values, Mapping) else (axis,))]
        moving = [name for name in names if name.startswith(_MOVE_THE_LIMIT)]
        if moving and self.loop is not None and self.loop.stability_margin is not None:
            raise InvalidInputError(
                f"stability_margin: found a margin beside a sweep over {moving[0]}, with which the limit of stability "
                "moves, expected none; leave it out, or sweep with a given gain"
            )
        return self.stable_bounds()

    def _shared(self) -> dict[str, Any]:
        """Return what every verb takes."""
        names = ("constraints", "impact", "method", "horizon")
        return {"bounds": self.stable_bounds()} | {name: getattr(self, name) for name in names}

    def _free(self) -> dict[str, Any]:
        return {
            "natural_frequency": self.natural_frequency_bounds,
            "damping_ratio": self.damping_ratio_bounds,
        }
