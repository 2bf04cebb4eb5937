"""What a scenario file asks beside one encounter and its gain: of what is uncertain, and of a loop."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, cast

from pretouch._core.errors import InvalidInputError
from pretouch._core.values import Value
from pretouch.design.robust.measures import Expected, Measure, Required
from pretouch.motion.scenario import Scenario
from pretouch.sensors import SensorModel
from pretouch.uncertainty import Uncertainty

if TYPE_CHECKING:
    from pretouch.control import Controller
    from pretouch.simulation import ClosedLoop, GainLimit, SensorPart

__all__ = ["DEFAULT_QUANTITIES", "LoopRequest", "RobustRequest"]

DEFAULT_QUANTITIES: Final = ("displacement", "relative_velocity")
"""What is traded where a file names nothing: L(20)'s two."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustRequest(Value):
    """What is asked of a robust gain.

    Args:
        uncertainty: what is known of the inputs; empty where the file says nothing of it.
        measure: what is made of the objectives of all encounters.
        constraints: the limits, each with the probability with which it must hold.
        samples: how many encounters the measure is taken over.
        validation: how many fresh ones the gain is held against.
        seed: of all samples.
        sampling: how samples are drawn.
        confidence: of the intervals.
    """

    uncertainty: Uncertainty = field(default_factory=dict)
    measure: Measure = field(default_factory=Expected)
    constraints: tuple[Required, ...] = ()
    samples: int = 4096
    validation: int = 4096
    seed: int = 0
    sampling: str = "sobol"
    confidence: float = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopRequest:
    """The sampled loop of a scenario file, and what is asked of it.

    Args:
        loop: the loop without its encounter; its law has the gain of the file, or 0 where that names none.
        gain: the gain to be checked [N s]; None for the one that is designed.
        runs: how often an encounter is repeated.
        part: the sensor part that the chain starts from, where the file names one.
        stability_margin: by how much the gain must be able to grow until the loop is unstable; None: not asked for.
    """

    loop: ClosedLoop
    gain: float | None
    runs: int
    part: SensorPart | None
    stability_margin: float | None

    def seeded(self, seed: int | None) -> ClosedLoop:
        """Return the loop with another seed of its noise; None: as it is."""
        return self.loop if seed is None else replace(self.loop, seed=seed)

    def stability_limit(self, scenario: Scenario, sensor: SensorModel) -> GainLimit:
        """Find the strongest stable gain at the distances that an encounter passes, from its start to contact.

        Args:
            scenario: the encounter.
            sensor: the sensor curve.

        Returns:
            The limit; some milliseconds of work.
        """
        from pretouch.simulation import gain_limit, timing_of  # noqa: PLC0415 - only for a file with a loop
        from pretouch.simulation.stability import passed_distances  # noqa: PLC0415

        controller = cast("Controller", self.loop.law)  # a file has no other law
        return gain_limit(
            sensor,
            scenario.admittance,
            timing_of(self.loop.chain, controller),
            distance=passed_distances(sensor, float(scenario.distance)),
            plant=self.loop.plant,
        )

    def stable_bounds(
        self, bounds: tuple[float, float], scenario: Scenario, sensor: SensorModel
    ) -> tuple[float, float]:
        """Cut the bounds of the gain so that it keeps the margin to instability that is asked for.

        Args:
            bounds: gains D_p [N s].
            scenario: the encounter.
            sensor: the sensor curve.

        Returns:
            The bounds [N s]; as they are where no margin is asked for.

        Raises:
            InvalidInputError: nothing is left of them.
        """
        margin = self.stability_margin
        if margin is None:
            return bounds
        strongest = self.stability_limit(scenario, sensor).strongest / margin
        low, high = max(bounds[0], strongest), min(bounds[1], -strongest)
        if not low < high:
            raise InvalidInputError(
                f"stability_margin: found {margin:g}, which allows gains up to {strongest:.4g} N*s, but [gain] has "
                f"bounds from {bounds[0]:g} to {bounds[1]:g} N*s, expected a smaller margin, weaker gains, a faster "
                "sensor or a larger virtual mass"
            )
        return low, high
