"""Define the sampled virtual drag, a control law.

The drag reduces every approach speed by the same fraction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from pretouch._core.blocks import Cell, Measured
from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import ONE_ROBOT, OUTPUT, check_declared, quantity

from .components import format_output
from .laws import CompiledStep, Setting
from .structures import DragNumbers, DragState

_HOLD = 0.02
_HOLD_READINGS = 2
_LARGEST = 1e6
_LONGEST_SMOOTHING = 60.0  # s, longer than any encounter
_LARGEST_NOISE = 1e12  # the largest accepted reading

_STEP = CompiledStep("step_drag")


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualDrag:
    """Sampled virtual drag, which reduces every approach speed by the same fraction.

    The force is F = -phi |s'| s' with s = ln xi, applied as impulses, during approaches only.

    While it acts, the admittance's pull toward the object is switched off, so d ln|l'|/dl = phi g^2/M. The relative
    speed to an object of constant velocity therefore falls by the same fraction at every speed, from detection to
    contact. An impulse is phi times the smoothed rate of s times the rise of s beyond a dead zone. The dead zone is as
    wide as the noise, so the robot does not move while nothing approaches.

    Args:
        drag: phi [N s^2].
        noise: standard deviation of a reading at xi = 0 [unit of xi]. If it is twice the true value,
            the contact speed is somewhat higher; if it is half the true value, the robot may creep.
        relative_noise: standard deviation of a reading divided by xi.
        resolution: quantization step of the readings [unit of xi].
        smoothing_time: time constant of the smoothed level and rate [s]. It delays the response to changes of speed.
            Choose at most 1/8 of the detection distance divided by the largest speed, such as 7 ms for 42 mm at
            0.75 m/s. Near a steady s', the impulse of a small change of s is 2 phi s' times the change, filtered by one
            low-pass; see `Law`.
        dead_zone: width of the dead zone of s, in standard deviations of the smoothed level. With a probability of 1 %,
            white noise rises by 8.8 standard deviations within a minute, and by 10.4 within an hour.
        still_rate: rate of s below which the object counts as still, in standard deviations of the rate. Smaller values
            keep the fraction constant down to lower speeds; larger values keep the retreat distance.
        hold_time: how long an approach lasts after the last rise of s [s]; None: 20 ms or two sensor periods, whichever
            is longer.
        own_advance: D_b <= 0 [N s], gain of a virtual damper against the robot's own motion toward the object. It
            brakes the robot to rest and never pushes it back. 0: none.
        known_acceleration: acceleration of the object toward the robot, <= 0 [m/s^2], such as gravity. M_a times this
            value is added to the force during an approach.

    Valid for:
        noise that is independent from reading to reading; median and low-pass of the conditioning only reduce it.

    Examples:
        >>> from pretouch.control import Conditioning, Controller, VirtualAdmittance
        >>> run = Controller(
        ...     period=1e-3,
        ...     conditioning=Conditioning(floor=100.0),
        ...     law=VirtualDrag(drag=0.0144, noise=0.0, smoothing_time=2e-3),
        ...     admittance=VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0),
        ... ).begin()
        >>> for k in range(20):  # an approach of s' = 10/s
        ...     force = run.step(2000.0 * 1.01005**k).virtual_force
        >>> round(force, 1)  # -0.0144 N s^2 x (10/s)^2, less 0.3 N that cancel the pull of the admittance
        -1.7
    """

    drag: float = quantity("N*s^2", sign="nonnegative", example='"0.0144 N*s^2"')
    noise: float = quantity(OUTPUT, sign="nonnegative", example="20.0")
    relative_noise: float = quantity("", 0.0, sign="nonnegative")
    resolution: float = quantity(OUTPUT, 0.0, sign="nonnegative")
    smoothing_time: float = quantity("s", 7e-3, sign="nonnegative")
    dead_zone: float = quantity("", 10.0, sign="nonnegative")
    still_rate: float = quantity("", 3.0, sign="nonnegative")
    hold_time: float | None = quantity("s", None, sign="nonnegative")
    own_advance: float = quantity("N*s", 0.0)
    known_acceleration: float = quantity("m/s^2", 0.0)

    def __post_init__(self) -> None:
        check_declared(self, instead=ONE_ROBOT)
        if self.own_advance > 0:
            raise InvalidInputError(
                f"own_advance: found {self.own_advance:g} N*s, expected 0 or a negative gain, because a positive "
                "gain would accelerate the robot",
                value=self.own_advance,
            )
        if self.known_acceleration > 0:
            raise InvalidInputError(
                f"known_acceleration: found {self.known_acceleration:g} m/s^2, expected 0 or a negative number "
                "(toward the robot). A positive number would make the robot follow an object that slows down",
                value=self.known_acceleration,
            )
        largest = dict.fromkeys(("drag", "dead_zone", "still_rate", "own_advance", "known_acceleration"), _LARGEST)
        largest |= dict.fromkeys(("noise", "relative_noise", "resolution"), _LARGEST_NOISE)
        largest["smoothing_time"] = _LONGEST_SMOOTHING
        for name, limit in largest.items():
            if not abs(getattr(self, name)) <= limit:
                raise InvalidInputError(
                    f"{name}: found {getattr(self, name):g}, which must be within {limit:g}", limit=limit
                )

    @property
    def continuous(self) -> str:
        """The name of the continuous-time law that this sampled virtual drag approximates."""
        return "virtual-drag"

    @property
    def value(self) -> float:
        """The coefficient phi of the virtual drag [N s^2].

        A design computes it.
        """
        return self.drag

    @property
    def step(self) -> CompiledStep:
        """The compiled control step with the virtual drag.

        It is the function `pretouch_step_drag` in pretouch_law.c.
        """
        return _STEP

    def numbers(self, controller: Setting) -> DragNumbers:
        """Return the parameters of the virtual drag as a C structure."""
        c, a = controller.conditioning, controller.admittance
        sensor_period = controller.period if c.sensor_period is None else c.sensor_period
        share = 1.0 if self.smoothing_time == 0 else -math.expm1(-sensor_period / self.smoothing_time)
        remaining, cubed = 1 - share, (2 - share) ** 3
        # Standard deviations of level and rate for independent readings of ln xi with unit variance, from the impulse
        # response of the filters.
        level_noise = math.sqrt(share * (1 + 4 * remaining + 5 * remaining * remaining) / cubed)
        rate_noise = math.sqrt(2 * share**3 / cubed) / sensor_period
        return DragNumbers(
            drag=self.drag,
            variance=self.noise**2 + self.resolution**2 / 12,
            relative_variance=self.relative_noise**2,
            level_share=share * (2 - share),
            rate_share=share * share,
            width=self.dead_zone * level_noise,
            still=self.still_rate * rate_noise,
            sensor_period=sensor_period,
            hold=max(_HOLD, _HOLD_READINGS * sensor_period) if self.hold_time is None else self.hold_time,
            own_advance=self.own_advance,
            known_acceleration=self.known_acceleration,
            period=controller.period,
            mass=a.mass,
            damping=a.damping,
            stiffness=a.stiffness,
        )

    def rows(self) -> Iterator[tuple[str, Cell]]:
        """Yield the settings of the virtual drag as table rows.

        The coefficient phi is not included.
        """
        yield "noise of a reading", format_output(self.noise)
        yield "relative noise of a reading", Measured(self.relative_noise)
        yield "step of the readings", format_output(self.resolution)
        yield "smoothing time", Measured(self.smoothing_time, "s")
        yield "dead zone", f"{self.dead_zone:.4g} standard deviations of the smoothed ln \u03be"
        yield "rate treated as zero", f"{self.still_rate:.4g} standard deviations"
        if self.hold_time is not None:
            yield "hold time of an approach", Measured(self.hold_time, "s")
        if self.own_advance:
            yield "gain against the robot's own motion", Measured(self.own_advance, "N*s")
        if self.known_acceleration:
            yield "known acceleration of the object", Measured(self.known_acceleration, "m/s^2")

    def with_value(self, value: float) -> VirtualDrag:
        """Return a copy of the virtual drag with another coefficient.

        The coefficient is phi [N s^2].
        """
        return replace(self, drag=value)

    def start(self) -> DragState:
        """Return the state of the virtual drag before the first reading."""
        return DragState(0.0, 0.0, 0.0, 0.0)
