"""Define components of the controller: filters for sensor readings, virtual admittance, and motion limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pretouch._core.errors import InvalidInputError
from pretouch._core.fields import ONE_ROBOT, OUTPUT, check_declared, count, quantity, units_of_fields
from pretouch._core.numbers import positive

from .structures import AdmittanceNumbers, FilterSection, MotionLimits, SensingNumbers

LONGEST_WINDOW = 16
"""Largest window of the running median, in readings."""

LONGEST_AVERAGE = 9
"""Largest window of the moving average, in readings: its zeros fill the second-order sections of the law."""

_SECTIONS = 4  # of the filters of the law together
_ANY_READING = 1e12
_ANY_FLOOR = 1e-24  # keeps ln(xi / floor) finite for every reading, also in single precision
_ANY_RATE = 1e15
_TIMEOUT_PERIODS = 10
_FADE_PERIODS = 2

_SERIES_RADIUS = 1.5
_TERMS = 26  # terms of the series; 1.5^26 / 28! is far below rounding

NO_LIMIT = 1e9
"""Value that means "no limit", in SI units. It is finite, so that every motion within the limits is finite."""

HIGHEST_ORDER = 8
"""Highest order of the low-pass."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditioning:
    """Settings for processing the sensor readings.

    The processing subtracts the offset, applies the detection threshold, filters readings and rejects faulty ones. It
    runs at the sensor's rate.

    Args:
        floor: detection threshold > 0 after the offset is subtracted [unit of xi]; choose it above noise and drift.
        offset: output without an object [unit of xi]; it is subtracted from each reading.
        saturation: raw reading from which the sensor is saturated [unit of xi]; None: never.
        sensor_period: nominal time between two readings [s], at least the loop's period; None: the loop's period.
        median_window: number of readings in the running median, 1 (no median) to 16; 10 in the letter.
        moving_average: number of readings in the moving average, 1 (none) to 9; it comes after the median, before the
            low-pass.
        low_pass_order: order of the Butterworth low-pass, 0 (none) to 8; 5 in the letter.
        cutoff: cutoff frequency of the low-pass [Hz]; 500 Hz in the letter.
        timeout: time without a usable reading after which the sensor counts as lost [s]; None: ten sensor periods.
        fade_time: time in which the force fades to zero when a reading is overdue [s]; None: two sensor periods; 0: it
            ends at once.
        largest_rate: largest plausible |d ln xi/dt| [1/s]: twice the steepest |g| times the fastest approach, plus
            noise; `pretouch verify` prints it. A reading that implies a larger rate is rejected. None: no check.

    Examples:
        >>> letter = Conditioning(floor=1e-3, median_window=10, low_pass_order=5, cutoff=500.0)
        >>> letter.numbers(1e-4).timeout
        0.001
    """

    floor: float = quantity(OUTPUT, sign="positive", example="30.0")
    offset: float = quantity(OUTPUT, 0.0)
    saturation: float | None = quantity(OUTPUT, None)
    sensor_period: float | None = quantity("s", None, sign="positive")
    median_window: int = count(1, 1, "3")
    moving_average: int = count(1, 1, "4")
    low_pass_order: int = count(0, 0, "2")
    cutoff: float | None = quantity("Hz", None, sign="positive")
    timeout: float | None = quantity("s", None, sign="positive")
    fade_time: float | None = quantity("s", None, sign="nonnegative")
    largest_rate: float | None = quantity("1/s", None, sign="positive")

    def __post_init__(self) -> None:
        check_declared(self, instead=ONE_ROBOT)
        if self.saturation is not None and not self.offset + self.floor < self.saturation <= _ANY_READING:
            raise InvalidInputError(
                f"saturation: found a level of {self.saturation:g}, expected a level above "
                f"{self.offset + self.floor:g}, the sum of offset and floor. The level must also be at most "
                f"{_ANY_READING:g}",
                value=self.saturation,
            )
        if not abs(self.offset) + self.floor < _ANY_READING:
            raise InvalidInputError(
                f"offset, floor: found an offset of {self.offset:g} and a floor of {self.floor:g}, expected "
                "|offset| + floor below 1e12",
                value=self.offset,
            )
        if not self.floor >= _ANY_FLOOR:
            raise InvalidInputError(
                f"floor: found a detection threshold of {self.floor:g}, expected at least {_ANY_FLOOR:g}; give the "
                "readings in a smaller unit",
                value=self.floor,
                limit=_ANY_FLOOR,
            )
        length: object = self.median_window
        if not isinstance(length, int) or isinstance(length, bool) or not 1 <= length <= LONGEST_WINDOW:
            raise InvalidInputError(
                f"median_window: found {length!r}, expected a whole number of readings from 1 (no median filter) "
                f"to {LONGEST_WINDOW}"
            )

    def numbers(self, period: float) -> SensingNumbers:
        """Return the settings of the signal processing as a C structure.

        `period` is the controller period [s].

        Raises:
            InvalidInputError: sensor period, timeout or cutoff frequency do not fit together.
        """
        sensor_period = period if self.sensor_period is None else self.sensor_period
        if sensor_period < period * (1 - 1e-9):
            raise InvalidInputError(
                f"sensor_period: found {sensor_period:g} s, expected at least the controller period of "
                f"{period:g} s. Run the controller at the sensor's rate, or use only every second or third "
                "reading",
                value=sensor_period,
                limit=period,
            )
        timeout = _TIMEOUT_PERIODS * sensor_period if self.timeout is None else self.timeout
        if timeout < sensor_period:
            raise InvalidInputError(
                f"timeout: found {timeout:g} s, expected at least {sensor_period:g} s, which is the time between "
                "two readings",
                value=timeout,
                limit=sensor_period,
            )
        low_pass = self.sections(1 / sensor_period)
        return SensingNumbers(
            period=period,
            sensor_period=sensor_period,
            offset=self.offset,
            floor=self.floor,
            saturation=_ANY_READING if self.saturation is None else self.saturation,
            timeout=timeout,
            largest_rate=_ANY_RATE if self.largest_rate is None else self.largest_rate,
            median_length=self.median_window,
            sections=len(low_pass),
            low_pass=(FilterSection * 4)(*low_pass),
        )

    def sections(self, rate: float) -> tuple[FilterSection, ...]:
        """Return the second-order sections of moving average and low-pass.

        Args:
            rate: readings per second [Hz].

        Raises:
            InvalidInputError: a filter is invalid, or both need more than four sections.
        """
        average = design_moving_average(self.moving_average)
        low_pass = design_low_pass(self.low_pass_order, self.cutoff, rate)
        if len(average) + len(low_pass) > _SECTIONS:
            raise InvalidInputError(
                f"moving_average, low_pass_order: found an average over {self.moving_average} readings and a low-pass "
                f"of order {self.low_pass_order}, expected filters that need at most {_SECTIONS} second-order sections "
                f"together, but they need {len(average)} and {len(low_pass)}; use one of both filters",
                value=self.moving_average,
            )
        return (*average, *low_pass)

    def fade_step(self, period: float) -> float:
        """Return the fraction by which the force fades per control period.

        It is the fraction of the virtual force that is removed while a reading is overdue. A fraction of 1 removes the
        force at once.
        """
        sensor_period = period if self.sensor_period is None else self.sensor_period
        fade_time = _FADE_PERIODS * sensor_period if self.fade_time is None else self.fade_time
        return min(period / fade_time, 1.0) if fade_time > 0 else 1.0


def design_moving_average(window: object) -> tuple[FilterSection, ...]:
    """Return the mean of the last N readings as second-order sections.

    The N - 1 zeros of 1 + z^-1 + ... + z^-(N-1) are the roots of unity other than 1. Each pair of conjugate zeros is a
    section without feedback, and -1, a zero of even N, is one of first order.

    Args:
        window: number of readings N.

    Raises:
        InvalidInputError: the window is invalid.
    """
    if not isinstance(window, int) or isinstance(window, bool) or not 1 <= window <= LONGEST_AVERAGE:
        raise InvalidInputError(
            f"moving_average: found {window!r}, expected a whole number of readings from 1 (no moving average) to "
            f"{LONGEST_AVERAGE}. A longer average is a delay of the sensor of half its length: add it to delay in "
            "[chain]",
            value=window,
            limit=LONGEST_AVERAGE,
        )
    sections = [FilterSection(0.5, 0.5, 0.0, 0.0, 0.0)] if window % 2 == 0 else []
    for k in range(1, (window + 1) // 2):
        turn = -2 * math.cos(2 * math.pi * k / window)
        b = 1 / (2 + turn)
        sections.append(FilterSection(b, turn * b, b, 0.0, 0.0))
    return tuple(sections)


def design_low_pass(order: object, cutoff: float | None, rate: float) -> tuple[FilterSection, ...]:
    """Design a Butterworth low-pass filter for a sampling rate [Hz].

    Returns:
        The sections, equal to those of scipy.signal, as a test checks. Importing scipy.signal would take too long.

    Raises:
        InvalidInputError: the order or the cutoff frequency is invalid.
    """
    if not isinstance(order, int) or isinstance(order, bool) or not 0 <= order <= HIGHEST_ORDER:
        raise InvalidInputError(
            f"low_pass_order: found {order!r}, expected a whole number from 0 (no low-pass filter) to {HIGHEST_ORDER}",
            value=order,
        )
    if order == 0:
        return ()
    if cutoff is None:
        raise InvalidInputError(
            f"cutoff: the cutoff frequency is missing, but a low-pass filter of order {order} needs a cutoff "
            "frequency in Hz"
        )
    frequency = positive(cutoff, "cutoff", "Hz")
    if not frequency < rate / 2:
        raise InvalidInputError(
            f"cutoff: found {frequency:g} Hz, expected less than {rate / 2:g} Hz, which is half of the sensor's "
            "sampling rate",
            value=frequency,
        )
    warped = math.tan(math.pi * frequency / rate)
    sections = [] if order % 2 == 0 else [_first_order(warped)]
    # The most damped section comes first. Each section has a DC gain of one.
    dampings = [math.sin(math.pi * (2 * k + 1) / (2 * order)) for k in range(order // 2)]
    return tuple(sections + [_second_order(warped, damping) for damping in reversed(dampings)])


def _first_order(warped: float) -> FilterSection:
    """Compute a first-order low-pass section by the bilinear transform."""
    b = warped / (1 + warped)
    return FilterSection(b, b, 0.0, (warped - 1) / (1 + warped), 0.0)


def _second_order(warped: float, damping: float) -> FilterSection:
    """Compute a second-order low-pass section by the bilinear transform."""
    square = warped * warped
    size = 1 + 2 * damping * warped + square
    b = square / size
    return FilterSection(b, 2 * b, b, 2 * (square - 1) / size, (1 - 2 * damping * warped + square) / size)


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualAdmittance:
    """Virtual mass M_a, damping D_a and stiffness K_a of the controller's admittance.

    The admittance is equation L(1).

    Args:
        mass: M_a > 0 [kg].
        damping: D_a >= 0 [N s/m].
        stiffness: K_a >= 0 [N/m].

    Examples:
        >>> VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0)
        VirtualAdmittance(mass=1.0, damping=10.0, stiffness=25.0)
    """

    mass: float = quantity("kg", sign="positive")
    damping: float = quantity("N*s/m", sign="nonnegative")
    stiffness: float = quantity("N/m", sign="nonnegative")

    def __post_init__(self) -> None:
        check_declared(self, instead=ONE_ROBOT)


def discretize(admittance: VirtualAdmittance, period: float) -> AdmittanceNumbers:
    """Discretize the admittance exactly for one control period with constant force.

    The admittance is equation L(1). Let z_1, z_2 be the roots of the free motion times the period. All six numbers
    follow from the divided differences G_0 = exp[z_1, z_2] and G_1 = exp[0, z_1, z_2]. Both are entire functions, so
    critical damping, zero stiffness and zero damping need no special case.

    Returns:
        Transition matrix and input vector.
    """
    m, t = admittance.mass, period
    p, q = -admittance.damping / m * t, admittance.stiffness / m * t * t
    g0, g1 = _differences(p, q)
    return AdmittanceNumbers(
        position_from_position=1.0 - q * g1,
        position_from_velocity=t * g0,
        velocity_from_position=-q / t * g0,
        velocity_from_velocity=1.0 + p * g0 - q * g1,
        position_from_force=t * t / m * g1,
        velocity_from_force=t / m * g0,
    )


def _differences(p: float, q: float) -> tuple[float, float]:
    """Return exp[z1, z2] and exp[0, z1, z2], divided differences, for z1 + z2 = p <= 0 and z1 z2 = q >= 0."""
    d = p * p / 4 - q
    magnitude = -p / 2 + math.sqrt(d) if d > 0 else math.sqrt(q)
    if magnitude < _SERIES_RADIUS:
        g0 = g1 = previous = 0.0
        symmetric = weight = 1.0
        for k in range(_TERMS):
            weight /= k + 1
            g0 += symmetric * weight
            g1 += symmetric * weight / (k + 2)
            symmetric, previous = p * symmetric - q * previous, symmetric
        return g0, g1
    if d > 0:
        far = -magnitude
        near = q / far
        g0 = -math.exp(near) * math.expm1(far - near) / (near - far)
        return g0, (g0 - (math.expm1(near) / near if near < 0 else 1.0)) / far
    angle = math.sqrt(-d)
    sinc = math.sin(angle) / angle if angle > 0 else 1.0
    decay = math.exp(p / 2)
    return decay * sinc, (1.0 - decay * (math.cos(angle) - p / 2 * sinc)) / q


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of the virtual force and the robot's motion.

    The motion is relative to the reference motion. None means no limit.

    All limits hold together for any force. A speed is allowed only if the plant can stop from it within the excursion
    limit at the largest deceleration. The stopping distance is piecewise linear in the speed, so the largest speed
    allowed in the next period follows in closed form. A state from which the plant can stop in time always has a next
    state with the same property. The admittance continues from the limited motion, so there is no windup.

    Args:
        force: largest |F_p| [N].
        speed: largest |x_v' - x_d'| [m/s].
        acceleration: largest |x_v'' - x_d''| [m/s^2], averaged over a period.
        excursion: largest |x_v - x_d| [m].

    Examples:
        >>> Limits(force=20.0, speed=0.5)
        Limits(force=20.0, speed=0.5, acceleration=None, excursion=None)
    """

    force: float | None = quantity("N", None, sign="positive")
    speed: float | None = quantity("m/s", None, sign="positive")
    acceleration: float | None = quantity("m/s^2", None, sign="positive")
    excursion: float | None = quantity("m", None, sign="positive")

    def __post_init__(self) -> None:
        check_declared(self, before="largest ", instead=ONE_ROBOT)
        for name, unit in units_of_fields(Limits).items():
            value = getattr(self, name)
            if value is not None and value > NO_LIMIT:
                raise InvalidInputError(
                    f"largest {name}: found a limit of {value!r}, expected at most {NO_LIMIT:g} {unit}; omit the "
                    "limit if there is none",
                    value=value,
                    limit=NO_LIMIT,
                )


def stopping_distance(limits: MotionLimits, speed: float) -> float:
    """Return the stopping distance of the robot from a speed [m].

    The speed is in m/s. The deceleration is constant in each control period. All periods but the last brake with the
    largest deceleration; the last one removes the remaining speed.
    """
    n = limits
    step = n.acceleration * n.period
    whole = math.floor(speed / step)
    rest = speed - whole * step
    return float(n.period * (step / 2 * whole * whole + rest * (whole + 0.5)))


def format_output(value: float) -> str:
    """Format a sensor output as text. Its unit is that of the readings, which the controller does not know."""
    return f"{value:.6g} (unit of the readings)"
