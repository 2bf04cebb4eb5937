"""A law as a user's package would bring it: its number is in N s^3, its section [law] has a key, and it can be sampled.

It is the letter's damper with the gain -c r^2 at a fixed rate r, so that everything can be compared with the letter's.
"""

from dataclasses import dataclass, replace

from pretouch.control import CompiledStep, VirtualDamper
from pretouch.fields import quantity
from pretouch.motion import DAMPER, LawNumber


@dataclass(frozen=True)
class Cube:
    """F = -c r^2 d(ln xi)/dt."""

    rate: float = quantity("1/s", 2.0, sign="positive", example='"2 1/s"')

    kind = "cube"
    number = LawNumber("cube", "c", "N*s^3", 1)
    degree = 1

    def gain(self, value):
        return -(self.rate**2) * value

    def contact(self, scenario, sensor, value, **options):
        return DAMPER.contact(scenario, sensor, self.gain(value), **options).with_gain(value)

    def motion(self, scenario, sensor, value, **options):
        motion = DAMPER.motion(scenario, sensor, self.gain(value), **options)
        return replace(motion, result=motion.result.with_gain(value))

    def damping(self, value, slope, relative_velocity):
        return DAMPER.damping(self.gain(value), slope, relative_velocity)

    def sampled(self, value):
        return SampledCube(value, self)


@dataclass(frozen=True)
class SampledCube:
    value: float
    continuous: Cube

    step = CompiledStep("step_damper")

    def numbers(self, controller):
        return VirtualDamper(gain=self.continuous.gain(self.value)).numbers(controller)

    def start(self):
        return VirtualDamper(gain=0.0).start()

    def with_value(self, value):
        return replace(self, value=value)
