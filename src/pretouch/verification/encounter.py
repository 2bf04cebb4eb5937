"""One run of the sampled loop beside what was predicted for it, and beside the same run without mitigation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import finite
from pretouch._core.values import Value
from pretouch.design.impact import ImpactModel
from pretouch.motion import ContactResult, Motion, Scenario, find_contact, solve_motion
from pretouch.sensors import SensorModel
from pretouch.simulation import ClosedLoop, LoopTrace, SimulationResult

from .encounter_comparison import (
    Detection,
    LoopContact,
    QuantityComparison,
    ReportedFlag,
    compare_contacts,
    contacts_of,
    detection_of,
    flags_of,
)

__all__ = ["SimulatedEncounter", "simulate_encounter"]

_HORIZON: Final = 600.0
_SAMPLES: Final = 400


@dataclass(frozen=True, kw_only=True, repr=False)
class SimulatedEncounter(Value):
    """What `simulate_encounter` returns: the runs and predictions at once, what they come to when it is first read.

    Args:
        scenario: the encounter.
        sensor: the sensor curve.
        loop: the loop that it was run on.
        gain: D_p [N s].
        impact: the physical properties, where given.
        method: by which the encounter was predicted, as `find_contact` takes it.
        horizon: how long the prediction waits for contact [s].
        run: on the loop with the gain.
        unmitigated: on the loop with gain 0, and with the same noise.
        prediction: by the continuous solution with the gain.
        unmitigated_prediction: by the continuous solution with gain 0.
    """

    scenario: Scenario
    sensor: SensorModel
    loop: ClosedLoop
    gain: float
    impact: ImpactModel | None
    method: str
    horizon: float
    run: SimulationResult
    unmitigated: SimulationResult
    prediction: ContactResult
    unmitigated_prediction: ContactResult

    @cached_property
    def trace(self) -> LoopTrace:
        """The course of the run with the gain."""
        return self.run.trace()

    @cached_property
    def unmitigated_trace(self) -> LoopTrace:
        """The course of the run with gain 0."""
        return self.unmitigated.trace()

    @cached_property
    def motion(self) -> Motion:
        """The predicted motion with the gain, until contact, or for as long as the run where there is none."""
        return self._motion(self.gain, self.prediction, self.run)

    @cached_property
    def unmitigated_motion(self) -> Motion:
        """The predicted motion with gain 0, until contact, or for as long as the run where there is none."""
        return self._motion(0.0, self.unmitigated_prediction, self.unmitigated)

    def _motion(self, gain: float, prediction: ContactResult, run: SimulationResult) -> Motion:
        horizon = self.horizon if prediction.reached.all() else min(self.horizon, run.end_time)
        return solve_motion(self.scenario, self.sensor, gain, method=self.method, horizon=horizon, samples=_SAMPLES)

    @property
    def has_contact_force(self) -> bool:
        """Whether the loop has a contact model, and so goes on after the first touch."""
        return self.loop.contact is not None

    @cached_property
    def comparisons(self) -> tuple[QuantityComparison, ...]:
        """The quantities of the contact on the loop and as predicted, with the gain and without."""
        return compare_contacts(
            (self.run, self.unmitigated),
            (self.prediction, self.unmitigated_prediction),
            impact=self.impact,
            has_contact_force=self.has_contact_force,
        )

    def comparison(self, name: str) -> QuantityComparison:
        """Return the comparison of one quantity.

        Args:
            name: such as `relative_velocity`.

        Returns:
            The comparison.

        Raises:
            InvalidInputError: that quantity is not compared.
        """
        for found in self.comparisons:
            if found.name == name:
                return found
        known = ", ".join(c.name for c in self.comparisons)
        raise InvalidInputError(f"name: found {name!r}, expected one of {known}")

    @cached_property
    def contacts(self) -> tuple[LoopContact, ...]:
        """The contacts of the run with the gain, a repeated contact one by one."""
        return contacts_of(self.run, has_contact_force=self.has_contact_force)

    @cached_property
    def unmitigated_contacts(self) -> tuple[LoopContact, ...]:
        """The contacts of the run with gain 0."""
        return contacts_of(self.unmitigated, has_contact_force=self.has_contact_force)

    @cached_property
    def flags(self) -> tuple[ReportedFlag, ...]:
        """What the law reported in the run with the gain, in the order in which it came."""
        return flags_of(self.trace, period=self.loop.law.period, contact_time=self.run.time)

    @cached_property
    def detection(self) -> Detection | None:
        """When and how far away the law first saw the object; None where it never did."""
        return detection_of(self.run, self.trace, self.sensor, self.scenario)

    @cached_property
    def headline(self) -> str:
        """What the run came to beside the prediction, in one sentence or two."""
        return encounter_headline(self)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Sentences that a user should read beside the numbers, in order of weight."""
        return tuple(encounter_warnings(self))

    def to_dict(self) -> dict[str, Any]:
        """Return the encounter as one JSON object: numbers in SI, None where there is none; without the traces."""
        return encounter_as_dict(self)

    def __repr__(self) -> str:
        return f"<SimulatedEncounter: {self.headline}>"

    def __str__(self) -> str:
        return encounter_as_text(self)

    def _repr_html_(self) -> str:
        return encounter_as_html(self)


def simulate_encounter(
    scenario: Scenario,
    sensor: SensorModel,
    loop: ClosedLoop,
    gain: float,
    *,
    impact: ImpactModel | None = None,
    method: str = "auto",
    horizon: float = _HORIZON,
) -> SimulatedEncounter:
    """Run one encounter on the sampled loop, and put it beside the continuous solution of L(1) with L(2).

    The loop is run with the gain and with gain 0, with the same noise; the prediction is made for both.

    Args:
        scenario: one encounter.
        sensor: the sensor curve.
        loop: the loop: sensor chain, law, robot and contact.
        gain: D_p [N s]; negative gains mitigate.
        impact: the physical properties, from which an elastic impact force is predicted.
        method: of the prediction, as `find_contact` takes it.
        horizon: how long the prediction waits for contact [s]; the loop has a horizon of its own.

    Returns:
        The runs, the predictions, and what they come to side by side.

    Raises:
        InvalidInputError: the scenario or the gain is an array.

    Examples:
        >>> from pretouch.control import Conditioning, Controller, VirtualAdmittance, VirtualDamper
        >>> from pretouch.motion import Admittance, Obstacle
        >>> from pretouch.sensors import InversePower
        >>> from pretouch.simulation import SensorChain
        >>> scenario = Scenario(
        ...     admittance=Admittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     obstacle=Obstacle(position=0.0422, velocity=-0.3),
        ... )
        >>> sensor = InversePower(scale=1.30e-5, distance_offset=0.0419, exponent=3.32)
        >>> loop = ClosedLoop(
        ...     law=Controller(
        ...         period=1e-3,
        ...         conditioning=Conditioning(floor=1e-3, sensor_period=4e-3),
        ...         law=VirtualDamper(gain=0.0),
        ...         admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        ...     ),
        ...     chain=SensorChain(rate=250.0, exposure=170e-6, delay=120e-6),
        ... )
        >>> encounter = simulate_encounter(scenario, sensor, loop, -0.7463)
        >>> round(encounter.comparison("relative_velocity").relative_difference, 3)
        0.001
    """
    if scenario.shape:
        raise InvalidInputError(
            f"scenario: found an array of encounters of shape {scenario.shape}, expected one; ClosedLoop.run takes many"
        )
    one = finite(gain, "gain", "N*s")
    if not isinstance(one, float):
        raise InvalidInputError("gain: found an array, expected one number: a controller runs with one gain")
    predictions = [find_contact(scenario, sensor, g, method=method, horizon=horizon) for g in (one, 0.0)]
    return SimulatedEncounter(
        scenario=scenario,
        sensor=sensor,
        loop=loop,
        gain=one,
        impact=impact,
        method=method,
        horizon=horizon,
        run=loop.run(scenario, sensor, one),
        unmitigated=loop.run(scenario, sensor, 0.0),
        prediction=predictions[0],
        unmitigated_prediction=predictions[1],
    )


from .encounter_summary import (  # noqa: E402 - it describes the class above
    encounter_as_dict,
    encounter_as_html,
    encounter_as_text,
)
from .encounter_wording import encounter_headline, encounter_warnings  # noqa: E402
