"""Model commercial proximity sensors with values from their data sheets."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Final

from pretouch._core.arguments import check_arguments
from pretouch._core.errors import InvalidInputError
from pretouch._core.messages import not_one_of

from .chain import SensorChain


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorPart:
    """A commercial sensor with a model based on its data sheet.

    The chain is a starting point: a calibration determines the noise better.

    Args:
        name: name of the part.
        chain: its chain at its usual rate, with outputs in `unit`.
        unit: unit of its output xi: V, counts, or empty if it reports a distance.
        range: distances at which it is used [m].
        signal: a distance [m] and the output that an object causes there [unit], which set the scale of a sensor curve;
            None for a part that reports a distance.
        source: the source of the facts.
        facts: values stated in the source.
        assumptions: values that the source does not state, assumed here.
        no_object: distances [m] that the part or its usual driver reports without an object.
        failed: distances [m] that the usual driver reports if a measurement fails.
        is_fastest: whether the source limits the rate to that of the chain.
    """

    name: str
    chain: SensorChain
    unit: str
    range: tuple[float, float]
    signal: tuple[float, float] | None
    source: str
    facts: tuple[str, ...]
    assumptions: tuple[str, ...]
    no_object: tuple[float, ...] = ()
    failed: tuple[float, ...] = ()
    is_fastest: bool = True

    @property
    def largest_rate(self) -> float:
        """The largest rate of readings by the source of the part [Hz].

        It is infinite if the source does not limit the rate.
        """
        return self.chain.rate if self.is_fastest else math.inf


@check_arguments
def sensor_part(name: str) -> SensorPart:
    """Return the commercial sensor with the given name.

    Args:
        name: a key of PARTS: "RPR-220", "VCNL4010", "VCNL4040", "APDS-9960", "VL53L0X", "VL53L1X", "VL53L5CX-4x4" or
            "VL53L5CX-8x8".

    Returns:
        The part: its chain, its range, their source and the assumptions.

    Raises:
        InvalidInputError: there is no such part.

    Examples:
        >>> sensor_part("VCNL4010").chain.rate
        250.0
    """
    if name not in PARTS:
        raise InvalidInputError(**not_one_of("name", name, PARTS))
    return PARTS[name]


_READ: Final = 9 * 5 / 400e3  # [s], nine clocks per byte at 400 kHz: address, register, address again, two data bytes
_counts: Final = partial(SensorChain, delay=_READ, lowest=0.0, highest=65535.0, resolution=1.0)


def _ranging(rate: float) -> SensorChain:
    """Return the model of a time-of-flight sensor with continuous measurement. It measures at a given rate [Hz]."""
    return SensorChain(
        rate=rate,
        exposure=1 / rate,
        delay=0.004,
        measures_distance=True,
        distance_noise=0.005,
        distance_resolution=0.001,
    )


_NO_TARGET: Final = (8.190, 8.191)  # 8192 mm minus the number of the error, by ST's community forum on imaging sensors
_TIMEOUT: Final = 65.535  # highest number of 16 bits, by Pololu's library vl53l0x-arduino
_TIME_OF_FLIGHT: Final = (
    "a reading averages over its whole period, as in continuous ranging",
    "4 ms from the end of a frame until its data are read, for about 300 bytes at 1 MHz and the driver",
    "distance noise of 5 mm: the data sheet gives the error, not its standard deviation; measure it on your target",
)

PARTS: Final[Mapping[str, SensorPart]] = MappingProxyType(
    {
        part.name: part
        for part in (
            SensorPart(
                name="RPR-220",
                chain=SensorChain(
                    rate=10_000.0, delay=1e-5, noise=2e-3, lowest=-10.0, highest=10.0, resolution=20.0 / 2**16
                ),
                unit="V",
                range=(0.0, 0.0422),
                signal=(0.0, 0.488),
                source="the letter, Section IV-B: three ROHM RPR-220 on a dSPACE MicroLabBox",
                facts=(
                    "read at 10 kHz",
                    "recessed behind an acrylic plate, used from contact to 42.2 mm",
                    "offset removed, then a median over 10 readings and a Butterworth low-pass of order 5 at 500 Hz: "
                    "these belong to the controller's conditioning",
                ),
                assumptions=(
                    "noise of 2 mV before the filters: the letter does not state it",
                    "0.488 V at contact: the curve of the letter's Table I",
                    "an analog input of 16 bits over +-10 V",
                    "10 us of response, typical of such phototransistors with a small load",
                ),
                is_fastest=False,
            ),
            SensorPart(
                name="VCNL4010",
                chain=_counts(rate=250.0, exposure=170e-6, noise=10.0),
                unit="counts",
                range=(0.001, 0.2),
                signal=(0.2, 30.0),
                source="Vishay data sheet of the VCNL4010, register 2 (proximity rate)",
                facts=("1.95 to 250 readings per second", "16 bits", "up to 200 mm"),
                assumptions=(
                    "170 us for a reading",
                    "two bytes read at 400 kHz as soon as they are ready, without waiting for a poll",
                    "noise of 10 counts with and without an object; noise that grows with xi is neglected",
                    "30 counts at 200 mm, three standard deviations of the noise",
                ),
            ),
            SensorPart(
                name="VCNL4040",
                chain=_counts(rate=200.0, exposure=125e-6, noise=2.0),
                unit="counts",
                range=(0.0, 0.2),
                signal=(0.2, 6.0),
                source="Vishay data sheet 84274 (Rev. 1.4) of the VCNL4040",
                facts=("emitter duty 1/40 to 1/320", "12 or 16 bits", "0 to 200 mm on a white card"),
                assumptions=(
                    "a pulse of 125 us at a duty cycle of 1/40, which gives a reading every 5 ms",
                    "two bytes read at 400 kHz as soon as they are ready",
                    "noise of 2 counts with and without an object; noise that grows with xi is neglected",
                    "6 counts at 200 mm, three standard deviations of the noise",
                ),
            ),
            SensorPart(
                name="APDS-9960",
                chain=SensorChain(
                    rate=100.0, exposure=1e-3, delay=_READ, noise=1.0, lowest=0.0, highest=255.0, resolution=1.0
                ),
                unit="counts",
                range=(0.0, 0.1),
                signal=(0.1, 3.0),
                source="Broadcom data sheet AV02-4191EN of the APDS-9960",
                facts=("8 bits", "1 to 64 pulses of 4 to 32 us for a reading"),
                assumptions=(
                    "100 readings per second, as in examples/firmware/apds9960",
                    "1 ms for a reading; two bytes read at 400 kHz as soon as they are ready",
                    "noise of 1 count with and without an object; noise that grows with xi is neglected",
                    "3 counts at 100 mm, three standard deviations of the noise",
                ),
                is_fastest=False,
            ),
            *(
                SensorPart(
                    name=name,
                    chain=_ranging(50.0),
                    unit="",
                    range=(0.02, farthest),
                    signal=None,
                    source=f"ST data sheet of the sensor {name}: range and shortest timing budget",
                    facts=(
                        "a reading every 20 ms with the shortest timing budget",
                        f"up to {farthest:g} m",
                        "8190 or 8191 mm without a target, by ST's community forum on imaging sensors",
                        *failures,
                    ),
                    assumptions=_TIME_OF_FLIGHT,
                    no_object=_NO_TARGET,
                    failed=(_TIMEOUT,) if failures else (),
                )
                for name, farthest, failures in (
                    ("VL53L0X", 2.0, ("65535 mm after a timeout, by Pololu's library vl53l0x-arduino",)),
                    ("VL53L1X", 4.0, ()),
                )
            ),
            *(
                SensorPart(
                    name=f"VL53L5CX-{zones}",
                    chain=_ranging(rate),
                    unit="",
                    range=(0.02, 4.0),
                    signal=None,
                    source="ST driver documentation of the VL53L5CX: highest ranging frequency of each resolution",
                    facts=(f"{zones} zones at up to {rate:g} Hz", "distances in mm", "20 mm to 4 m"),
                    assumptions=_TIME_OF_FLIGHT,
                )
                for zones, rate in (("4x4", 60.0), ("8x8", 15.0))
            ),
        )
    }
)
"""The parts by name. Everything except `facts` is a starting point."""
