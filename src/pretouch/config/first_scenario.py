"""Write a first scenario file for a user's robot.

Every value that the user should check has a comment.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.designs.task import Task
from pretouch.simulation import SensorPart
from pretouch.simulation.detection import AGREES, detection_distance

_TEXT: Final = """\
# A first scenario, written by pretouch init. Check every value, and replace what you know better.
# Keys, units and further sections: docs/reference/scenario-file.md

{sensor}
[admittance]                      # virtual dynamics: how the controller turns a force into a motion
mass = "1 kg"                     # virtual, not the mass of the robot
natural_frequency = "{frequency}"   # how fast the robot returns to its task; critically damped

[obstacle]                        # what approaches
position = "{position}"            # where the floor of [controller] detects it: the law acts from there on
velocity = "-{speed}"            # negative: toward the robot; also change the mean in [uncertainty]
{acceleration}
[objective]                       # what the design minimizes: retreat and contact speed, each relative to its scale
kind = "excursion"
position_scale = "{excursion}"
velocity_scale = "{speed}"

[gain]                            # range of the search; mitigating gains are negative
bounds = ["{strongest}", "{weakest}"]

{law}[constraints]                     # limits; the design keeps them, and pretouch verify checks them
excursion = "{excursion}"            # how far the robot can retreat
{contact_speed}{impact_force}
[impact]                          # physical properties, for contact forces; pretouch project computes the mass
robot_mass = "{robot_mass}"             # reflected mass at the contact point; change it together with mass in [robot]
{padding}
[uncertainty]                     # pretouch robust and pretouch verify vary these inputs
{spread_source}
# normal = [mean, standard deviation]: change the mean together with velocity in [obstacle]
obstacle.velocity = {{ normal = ["-{speed}", "{spread}"], between = ["-{fastest}", "-{slowest}"] }}

[chain]                           # the sensor as it runs on the robot
{chain}
[controller]
rate = "{control_rate}"
largest_excursion = "{excursion}"    # the law moves the robot no farther, even if the sensor fails
{damper}{controller}
[robot]                           # how the robot follows commands; replace by your robot
kind = "impedance"
mass = "{robot_mass}"             # change it together with robot_mass in [impact]
stiffness = "4 kN/m"
damping = "250 N*s/m"
bandwidth = "80 Hz"

[loop]
horizon = "{horizon}"
stability_margin = 2.0            # the gain can double before the loop oscillates

[verify]
runs = 500
"""
_CALIBRATED: Final = """\
[sensor]                          # the curve is fitted to your calibration whenever the file is read
calibration = {calibration}
{reading}{recess}"""
_TYPICAL: Final = """\
[sensor]                          # NOT your sensor: a typical curve with the signal of a {part}
model = "inverse-power"           # measure your own: pretouch record, then calibration = "sensor.csv"
scale = {scale}
distance_offset = "41.9 mm"
exponent = 3.32
{recess}"""
_RANGING: Final = """\
[sensor]                          # the controller converts each distance of the {part} to an output on this curve
model = "inverse-power"           # you may choose another curve; it needs no calibration
scale = {scale}
distance_offset = "41.9 mm"
exponent = 3.32
{recess}"""
_DRAG: Final = """\
[law]                             # the virtual drag: contact speed is this share of every approach speed
kind = "virtual-drag"
ratio = 0.15
smoothing_time = "5 ms"
{noise}
"""
_COMMENT: Final = re.compile(r"^([^\s#][^#\n]*?) {2,}(# .*)$", re.MULTILINE)
_COLUMN: Final = 42  # of the comments
_OFFSET: Final = 0.0419  # m, of the typical curve, the letter's Table I
_EXPONENT: Final = 3.32
_CONTROL_RATE: Final = 1000.0  # Hz, of a controller whose rate is not given
_LONGEST: Final = 20.0  # times the time to contact without mitigation, until which runs wait for contact
_SHORTEST: Final = 5.0  # s: runs wait at least so long
_WAITING: Final = 5.0  # sensor periods: with a longer latency, the controller needs a longer timeout
_DAMPER: Final = """\
approach_only = true                 # the force ends if a sensor fails, or if an object leaves
"""
_SPREAD: Final = 0.2  # standard deviation of the approach speed that is assumed, as a share of the speed
_FARTHEST: Final = 3.0  # standard deviations: speeds farther from the mean are left out
_SLOWEST: Final = 0.05  # smallest speed with a wide spread, as a share of the speed
_ASSUMED_SPREAD: Final = (
    "# ASSUMED: a spread of 20 %; pretouch init --speed-spread sets it. Limits apply to the fastest"
)
_GIVEN_SPREAD: Final = "# between: three standard deviations to either side, but no standstill"
_SIGMAS: Final = 3.0  # smallest floor, in standard deviations of the noise
_PROVISIONAL: Final = 1.0  # floor with which the output of a sensor without noise is computed


@dataclass(frozen=True, kw_only=True)
class FirstScenario(Value):
    """Inputs of a first scenario file: sensor, robot, approach and limits.

    Args:
        calibration: path of a calibration file as the scenario file names it; empty for none.
        columns: the columns of distance and output in the calibration; empty to find them.
        labels: the label columns of the calibration; None for all columns except distance and output.
        select: the labels of the curve in the calibration.
        recess: distance of the sensor behind the contact surface [m].
        part: the built-in sensor part; None for any other sensor.
        rate: readings per second [Hz].
        control_rate: control steps per second [Hz]; None for 1 kHz, or the rate of a faster sensor.
        latency: time from the end of an exposure until its reading is available [s]; None for that of the part.
        distance: distance at the start of the encounter [m].
        floor: detection threshold of the controller [output unit]; None for three standard deviations of the noise.
        speed: approach speed at the start [m/s].
        speed_spread: standard deviation of the approach speed [m/s]; None for 20 % of the speed, as an assumption.
        acceleration: acceleration of the object [m/s^2], negative toward the robot.
        excursion: largest distance by which the robot can retreat [m].
        contact_speed: largest allowed speed at contact [m/s]; None for no limit.
        impact_force: largest allowed impact force [N]; None for no limit.
        robot_mass: reflected mass of the robot [kg].
        stiffness: stiffness of the contact [N/m]; None for a padding by `effective_modulus` and `radius`.
        effective_modulus: effective modulus of the padding [Pa].
        radius: radius of the contact surface [m].
        drag: whether to use the virtual drag instead of the virtual damper.
    """

    calibration: str
    columns: Mapping[str, str | int]
    labels: Sequence[str | int] | None
    select: Mapping[str, str | int | float]
    recess: float
    part: SensorPart | None
    rate: float
    control_rate: float | None
    latency: float | None
    distance: float
    floor: float | None
    speed: float
    speed_spread: float | None
    acceleration: float
    excursion: float
    contact_speed: float | None
    impact_force: float | None
    robot_mass: float
    stiffness: float | None
    effective_modulus: float
    radius: float
    drag: bool

    @property
    def control(self) -> float:
        """Control steps per second [Hz].

        The controller is at least as fast as the sensor, unless its rate is given.
        """
        if self.control_rate is not None:
            return self.control_rate
        data_sheet = self.part is not None and self.rate == self.part.chain.rate
        return _CONTROL_RATE if data_sheet else max(_CONTROL_RATE, self.rate)

    def text(self) -> str:
        """Return the text of the scenario file."""
        speed, limit = _as_text(self.speed, "m/s"), self.contact_speed
        contact = (
            f'relative_velocity = "{_as_text(limit, "m/s")}"    # largest speed at contact\n'
            if limit
            else ('# relative_velocity = "0.1 m/s" # largest speed at contact\n')
        )
        spread = _SPREAD * self.speed if self.speed_spread is None else self.speed_spread
        fastest, slowest = self.speed + _FARTHEST * spread, self.speed - _FARTHEST * spread
        unit = "N*s^2" if self.drag else "N*s"
        ends = ("0.0001", "1") if self.drag else ("-10", "-0.001")
        text = _TEXT.format(
            sensor=self._sensor(),
            frequency="5 rad/s",
            position=_as_text(self.distance, "m"),
            speed=speed,
            excursion=_as_text(self.excursion, "m"),
            strongest=f"{ends[0]} {unit}",
            weakest=f"{ends[1]} {unit}",
            law=_DRAG.format(noise=self._noise()) if self.drag else "",
            damper="" if self.drag else _DAMPER,
            acceleration=self._acceleration(),
            contact_speed=contact,
            impact_force="" if self.impact_force is None else f'impact_force = "{_as_text(self.impact_force, "N")}"\n',
            padding=self._padding(),
            control_rate=_as_text(self.control, "Hz"),
            horizon=_as_text(max(_SHORTEST, _LONGEST * self.distance / self.speed), "s"),
            robot_mass=_as_text(self.robot_mass, "kg"),
            spread=_as_text(spread, "m/s"),
            fastest=_as_text(fastest, "m/s"),
            slowest=_as_text(max(slowest, _SLOWEST * self.speed), "m/s"),
            spread_source=_ASSUMED_SPREAD if self.speed_spread is None else _GIVEN_SPREAD,
            chain=self._chain(),
            controller=self._controller(),
        )
        return _COMMENT.sub(lambda line: f"{line[1]:<{_COLUMN}}{line[2]}", text)

    def _sensor(self) -> str:
        if self.calibration:
            return _CALIBRATED.format(
                calibration=_quoted(self.calibration), reading=self._reading(), recess=self._recess()
            )
        name = "sensor" if self.part is None else self.part.name
        at, output = self._signal()
        unit = "" if self.part is None else self.part.unit
        number = f"{output * (at + _OFFSET) ** _EXPONENT:.4g}"
        return (_RANGING if self._reports_distance else _TYPICAL).format(
            part=name, scale=f'"{number} {unit}"' if unit else number, recess=self._recess()
        )

    def _recess(self) -> str:
        line = f'recess = "{_as_text(self.recess, "m")}"  # mount the sensor this far behind the contact surface\n'
        return line if self.recess else ""

    def _acceleration(self) -> str:
        if not self.acceleration:
            return ""
        acceleration = _as_text(self.acceleration, "m/s^2")
        return f'acceleration = "{acceleration}"  # negative: toward the robot, as gravity on a leg\n'

    def _padding(self) -> str:
        if self.stiffness is not None:
            return f'stiffness = "{_as_text(self.stiffness, "N/m")}"  # of the contact\n'
        modulus, radius = _as_text(self.effective_modulus, "Pa"), _as_text(self.radius, "m")
        return f'effective_modulus = "{modulus}"  # of the padding; 10 MPa: a padded link\nradius = "{radius}"\n'

    def _reading(self) -> str:
        """Return the scenario-file lines that select calibration columns and curve."""
        lines = []
        if self.columns:
            lines.append(f"columns = {_table(self.columns)}")
        if self.labels is not None:
            lines.append(f"labels = [{', '.join(map(_quoted, self.labels))}]")
        if self.select:
            lines.append(f"select = {_table(self.select)}")
        return "".join(f"{line}\n" for line in lines)

    def _signal(self) -> tuple[float, float]:
        """Return a distance and the typical sensor output at this distance."""
        signal = None if self.part is None else self.part.signal
        return signal or (3.0 * self.distance, 1.0)

    @property
    def _reports_distance(self) -> bool:
        """Whether the sensor reports a distance. The scenario file then needs a value for the floor."""
        return self.part is not None and self.part.chain.measures_distance

    def _noise(self) -> str:
        return "noise = 0.3                       # of the sensor output\n" if self._reports_distance else ""

    def _chain(self) -> str:
        rate = min(self.rate, self.control)
        cause = "the controller reads it once per period" if self.rate > self.control else ""
        if self.part is None:
            noise = "" if self.calibration else "noise = 0.02                      # of the sensor output; measure it\n"
            line = f'rate = "{_as_text(rate, "Hz")}"  # {cause or "readings per second; measure it"}\n'
            return f"{line}{self._delay()}{noise}"
        lines = f'part = "{self.part.name}"  # data sheet; pretouch replay measures rate, delay and noise\n'
        sheet = self.part.chain
        if rate != sheet.rate:
            most = self.part.largest_rate
            faster = f"the data sheet gives at most {_as_text(most, 'Hz')}" if rate > most else ""
            lines += f'rate = "{_as_text(rate, "Hz")}"  # {cause or faster or "readings per second"}\n'
        if sheet.exposure > 1 / rate:
            lines += f'exposure = "{_as_text(1 / rate, "s")}"  # a reading averages over its whole period\n'
        return f"{lines}{self._delay()}"

    def _delay(self) -> str:
        if self.latency is None:
            return ""
        delay = _as_text(self.latency, "s")
        return f'delay = "{delay}"  # from the end of an exposure until the controller has the reading\n'

    def _controller(self) -> str:
        lines = ""
        if self.floor is not None or self._reports_distance:
            floor = _PROVISIONAL if self.floor is None else self.floor
            lines = f"floor = {floor:.4g}  # smallest sensor output that counts as an object: that at the start\n"
        if self.latency is not None and self.latency * min(self.rate, self.control) > _WAITING:
            lines += f'timeout = "{_as_text(3 * self.latency, "s")}"  # well above the latency\n'
        return lines

    def starting_where_detected(self, load: Callable[[str], Task], *, keep_distance: bool) -> FirstScenario:
        """Return the scenario with a floor that detects the object where the encounter starts.

        The floor is the output at the start, but at least three standard deviations of the noise. If the object is then
        detected nearer, the encounter starts there.

        Args:
            load: function that reads the text of a scenario file.
            keep_distance: whether the user gave the distance at the start.

        Raises:
            InvalidInputError: at the given distance, the signal is lost in the noise.
        """
        task = load(self.text())
        chain, conditioning = task.loop.chain, task.loop.law.conditioning
        output = float(np.exp(task.sensor.log_output(self.distance)))
        noise = chain.additive_noise
        floor = float(f"{max(output, _SIGMAS * noise):.3g}")
        found = detection_distance(task.sensor, chain, replace(conditioning, floor=floor, saturation=None))
        if found >= self.distance * (1 - AGREES):
            return replace(self, floor=floor)
        farthest = format_quantity(found, "m", 3)
        if keep_distance or not found > 0:
            raise InvalidInputError(
                f"--distance: at {format_quantity(self.distance, 'm')}, the sensor output is {output:.3g}, less than "
                f"three standard deviations of the noise ({_SIGMAS * noise:.3g}). Start at most at {farthest}"
            )
        return replace(self, floor=floor, distance=float(f"{found:.3g}"))


def _quoted(text: object) -> str:
    """Return a text as a quoted TOML string."""
    return json.dumps(str(text), ensure_ascii=False)


def _table(texts: Mapping[str, object]) -> str:
    """Return a dictionary of texts as an inline TOML table."""
    keys = {key: key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _quoted(key) for key in texts}
    return f"{{ {', '.join(f'{keys[key]} = {_quoted(text)}' for key, text in texts.items())} }}"


def _as_text(value: float, unit: str) -> str:
    """Format a quantity for a scenario file."""
    for scale, larger in _LARGER.get(unit, ()):
        if value >= scale:
            return f"{value / scale:.4g} {larger}"
    return format_quantity(value, unit, 4)


_LARGER: Final = {"Hz": ((1e3, "kHz"),), "Pa": ((1e9, "GPa"), (1e6, "MPa")), "N/m": ((1e6, "MN/m"), (1e3, "kN/m"))}
"""Larger units of large values."""
