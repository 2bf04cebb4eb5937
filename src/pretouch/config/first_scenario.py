"""Write a first scenario file for a user's robot.

Every value that the user should check has a comment.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.simulation import SensorPart

_TEXT: Final = """\
# A first scenario, written by pretouch init. Check every value, and replace what you know better.
# Keys, units and further sections: docs/reference/scenario-file.md

{sensor}
[admittance]                      # virtual dynamics: how the controller turns a force into a motion
mass = "1 kg"                     # virtual, not the mass of the robot
natural_frequency = "{frequency}"   # how fast the robot returns to its task; critically damped

[obstacle]                        # what approaches; position when the sensor first sees it
position = "{position}"
velocity = "-{speed}"            # negative: toward the robot; also change the mean in [uncertainty]

[objective]                       # what the design minimizes: retreat and contact speed, each relative to its scale
kind = "excursion"
position_scale = "{excursion}"
velocity_scale = "{speed}"

[gain]                            # range of the search; mitigating gains are negative
bounds = ["{strongest}", "{weakest}"]

{law}[constraints]                     # limits; the design keeps them, and pretouch verify checks them
excursion = "{excursion}"            # how far the robot can retreat
{contact_speed}
[impact]                          # physical properties, for contact forces; pretouch project computes the mass
robot_mass = "{robot_mass}"             # reflected mass at the contact point; change it together with mass in [robot]
effective_modulus = "10 MPa"      # a padded link
radius = "10 mm"

[uncertainty]                     # pretouch robust and pretouch verify vary these inputs
# normal = [mean, standard deviation]: change the mean together with velocity in [obstacle]
obstacle.velocity = {{ normal = ["-{speed}", "{spread}"], between = ["-{fastest}", "-{slowest}"] }}

[chain]                           # the sensor as it runs on the robot
{chain}
[controller]
rate = "1 kHz"
largest_excursion = "{excursion}"    # the law moves the robot no farther, even if the sensor fails
{controller}
[robot]                           # how the robot follows commands; replace by your robot
kind = "impedance"
mass = "{robot_mass}"             # change it together with robot_mass in [impact]
stiffness = "4 kN/m"
damping = "250 N*s/m"
bandwidth = "80 Hz"

[loop]
horizon = "5 s"
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
"""
_RANGING: Final = """\
[sensor]                          # the controller converts each distance of the {part} to an output on this curve
model = "inverse-power"           # you may choose another curve; it needs no calibration
scale = {scale}
distance_offset = "41.9 mm"
exponent = 3.32
"""
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
        rate: readings per second [Hz], for a sensor that is no built-in part.
        distance: distance at which the sensor first sees the object [m].
        speed: approach speed [m/s].
        excursion: largest distance by which the robot can retreat [m].
        contact_speed: largest allowed speed at contact [m/s]; None for no limit.
        robot_mass: reflected mass of the robot [kg].
        drag: whether to use the virtual drag instead of the virtual damper.
    """

    calibration: str
    columns: Mapping[str, str | int]
    labels: Sequence[str | int] | None
    select: Mapping[str, str | int | float]
    recess: float
    part: SensorPart | None
    rate: float
    distance: float
    speed: float
    excursion: float
    contact_speed: float | None
    robot_mass: float
    drag: bool

    def text(self) -> str:
        """Return the text of the scenario file."""
        speed, limit = _as_text(self.speed, "m/s"), self.contact_speed
        contact = (
            f'relative_velocity = "{_as_text(limit, "m/s")}"    # largest speed at contact\n'
            if limit
            else ('# relative_velocity = "0.1 m/s" # largest speed at contact\n')
        )
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
            contact_speed=contact,
            robot_mass=_as_text(self.robot_mass, "kg"),
            spread=_as_text(0.2 * self.speed, "m/s"),
            fastest=_as_text(1.6 * self.speed, "m/s"),
            slowest=_as_text(0.4 * self.speed, "m/s"),
            chain=self._chain(),
            controller=self._controller(),
        )
        return _COMMENT.sub(lambda line: f"{line[1]:<{_COLUMN}}{line[2]}", text)

    def _sensor(self) -> str:
        if self.calibration:
            line = f'recess = "{_as_text(self.recess, "m")}"  # the sensor is this far behind the contact surface\n'
            recess = line if self.recess else ""
            return _CALIBRATED.format(calibration=_quoted(self.calibration), reading=self._reading(), recess=recess)
        name = "sensor" if self.part is None else self.part.name
        at, output = self._signal()
        unit = "" if self.part is None else self.part.unit
        number = f"{output * (at + _OFFSET) ** _EXPONENT:.4g}"
        return (_RANGING if self._reports_distance else _TYPICAL).format(
            part=name, scale=f'"{number} {unit}"' if unit else number
        )

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
        """Whether the sensor reports a distance.

        The scenario file then needs a value for the floor.
        """
        return self.part is not None and self.part.chain.measures_distance

    def _noise(self) -> str:
        return "noise = 0.3                       # of the sensor output\n" if self._reports_distance else ""

    def _chain(self) -> str:
        if self.part is None:
            noise = "" if self.calibration else "noise = 0.02                      # of the sensor output; measure it\n"
            return f'rate = "{_as_text(self.rate, "Hz")}"                   # readings per second; measure it\n{noise}'
        lines = (
            f'part = "{self.part.name}"                 # data sheet; pretouch replay measures rate, delay and noise\n'
        )
        if self.part.chain.rate > 1000.0:
            lines += 'rate = "1 kHz"                    # the controller reads it once per period\n'
        return lines

    def _controller(self) -> str:
        floor = "floor = 1.0                       # smallest sensor output that counts as an object\n"
        return floor if self._reports_distance else ""


def _quoted(text: object) -> str:
    """Return a text as a quoted TOML string."""
    return json.dumps(str(text), ensure_ascii=False)


def _table(texts: Mapping[str, object]) -> str:
    """Return a dictionary of texts as an inline TOML table."""
    keys = {key: key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _quoted(key) for key in texts}
    return f"{{ {', '.join(f'{keys[key]} = {_quoted(text)}' for key, text in texts.items())} }}"


def _as_text(value: float, unit: str) -> str:
    """Format a quantity for a scenario file."""
    return format_quantity(value, unit, 4)
