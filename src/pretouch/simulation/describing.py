"""What every page says of a sampled loop: sensor chain, controller, robot, contact, as rows and as sentences."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from pretouch._core.block_text import cell_as_text
from pretouch._core.blocks import Cell, Chapter, Measured, Rows
from pretouch._core.units import format_quantity
from pretouch.control import Controller, VirtualDamper

from .chain import SensorChain
from .closed_loop import ClosedLoop
from .contact import ContactModel
from .law import SampledLaw

__all__ = ["chain_rows", "contact_rows", "controller_rows", "loop_rows", "loop_section", "loop_sentences"]

Row = tuple[str, Cell]


def loop_section(loop: ClosedLoop, *first: Row) -> Chapter:
    """Return the section of a page that says what a loop is made of, after rows of the page's own."""
    parts = (
        ("Sensor chain", chain_rows(loop.chain)),
        ("Controller", controller_rows(loop.law)),
        ("Robot", loop.plant.rows()),
        ("Contact", contact_rows(loop.contact)),
    )
    sections = (Chapter(title=title, blocks=(Rows(rows=tuple(rows), wraps=True),)) for title, rows in parts)
    return Chapter(title="The loop", blocks=(Rows(rows=(*first, *loop_rows(loop))), *sections))


def loop_sentences(loop: ClosedLoop) -> Iterator[str]:
    """Yield what a loop is made of in a sentence for each part, in plain text."""
    yield f"Sensor: {_joined(chain_rows(loop.chain))}; noise is normal, and independent from reading to reading."
    yield f"Controller: {_joined(controller_rows(loop.law))}."
    follow = () if loop.contact is None else (("followed for", Measured(loop.follow, "s")),)
    for rows in (loop.plant.rows(), (*contact_rows(loop.contact), *follow)):
        (name, kind), *others = rows
        yield f"{name.capitalize()}: {'; '.join(part for part in (cell_as_text(kind), _joined(others)) if part)}."


def _joined(rows: Iterable[Row]) -> str:
    return "; ".join(f"{name} {cell_as_text(cell)}" for name, cell in rows).replace("\u03be", "xi")


def loop_rows(loop: ClosedLoop) -> Iterator[Row]:
    """Yield how runs of a loop are drawn and how long they last."""
    yield "seed of the noise", str(loop.seed)
    yield "waits for contact", Measured(loop.horizon, "s")
    if loop.contact is not None:
        yield "goes on after the first contact", Measured(loop.follow, "s")


def chain_rows(chain: SensorChain) -> Iterator[Row]:
    """Yield the parameters of a sensor chain, those that are zero and need not be left out."""
    yield "readings", f"{format_quantity(chain.rate, 'Hz')}, one every {format_quantity(chain.period, 's')}"
    start = f"after {format_quantity(chain.phase, 's')} in every run"
    yield "first exposure", "at another instant of the period in each run" if chain.random_phase else start
    yield "exposure", Measured(chain.exposure, "s")
    yield "delay after the exposure", Measured(chain.delay, "s")
    yield "age of a new reading", f"{format_quantity(chain.latency, 's')}, from the middle of its exposure"
    if chain.reports_distance:
        yield "reports", "a distance, which its driver turns into \u03be by the curve"
        yield "noise of the distance", Measured(chain.distance_noise, "m")
        yield "step of the distance", Measured(chain.distance_resolution, "m")
    yield "noise without a signal", _output(chain.noise)
    yield "noise relative to \u03be", _percent(chain.relative_noise)
    if chain.misfit:
        alike = f"alike over {format_quantity(chain.misfit_length, 'm')} of distance"
        yield "misfit of the curve relative to \u03be", f"{_percent(chain.misfit)}, another in each run, {alike}"
    for label, value in (("ambient offset", chain.offset), ("crosstalk", chain.crosstalk), ("step", chain.resolution)):
        if value:
            yield label, _output(value)
    if chain.drift:
        yield "drift", f"{chain.drift:.4g} [unit of \u03be per s]"
    if math.isfinite(chain.lowest) or math.isfinite(chain.highest):
        yield "clips", f"below {chain.lowest:.6g} and above {_output(chain.highest)}"
    if chain.jitter:
        yield "jitter of an exposure", Measured(chain.jitter, "s")
    if chain.dropout:
        yield "readings that are missing", _percent(chain.dropout)


def _output(value: float) -> str:
    return f"{value:.6g} [unit of \u03be]"


def _percent(share: float) -> str:
    return f"{100 * share:.4g} %"


def controller_rows(law: SampledLaw) -> Iterator[Row]:
    """Yield the parameters of a controller, its gain left out; of any other law its name and its period."""
    yield "law", type(law.law if isinstance(law, Controller) else law).__name__
    yield "period", Measured(law.period, "s")
    if not isinstance(law, Controller):
        return
    if isinstance(law.law, VirtualDamper):
        if law.law.approach_only:
            yield "damps", f"approaches alone, with a release of {law.law.release:.4g} in ln \u03be"
        if law.law.ramp_time:
            yield "ramp of the gain", Measured(law.law.ramp_time, "s")
    yield from _conditioning_rows(law)
    a = law.admittance
    yield "virtual mass M_a", Measured(a.mass, "kg")
    yield "virtual damping D_a", Measured(a.damping, "N*s/m")
    yield "virtual stiffness K_a", Measured(a.stiffness, "N/m")
    limits = (
        ("largest virtual force", law.limits.force, "N"),
        ("largest speed", law.limits.speed, "m/s"),
        ("largest acceleration", law.limits.acceleration, "m/s^2"),
        ("largest excursion", law.limits.excursion, "m"),
    )
    if all(value is None for _, value, _ in limits):
        yield "limits", "none"
    yield from ((f"limit: {label}", Measured(value, unit)) for label, value, unit in limits if value is not None)
    yield "share of the contact force in the admittance", Measured(law.contact_gain)
    yield "reports a contact from", Measured(law.contact_threshold, "N")


def _conditioning_rows(law: Controller) -> Iterator[Row]:
    """Yield what is done to a reading before its logarithm is differenced."""
    c, used = law.conditioning, law.conditioning.numbers(law.period)
    yield "expects a reading every", Measured(used.sensor_period, "s")
    yield "offset taken off", _output(c.offset)
    yield "floor", f"{_output(c.floor)}, below which nothing is seen"
    if c.saturation is not None:
        yield "saturated from", _output(c.saturation)
    yield "running median", f"over {c.median_window} readings" if c.median_window > 1 else "none"
    if c.low_pass_order and c.cutoff is not None:
        yield "low-pass", f"Butterworth of order {c.low_pass_order} at {format_quantity(c.cutoff, 'Hz')}"
    else:
        yield "low-pass", "none"
    yield "sensor lost after", Measured(used.timeout, "s")
    if c.largest_rate is not None:
        yield "largest |d ln \u03be/dt| that is believed", Measured(c.largest_rate, "1/s")


def contact_rows(contact: ContactModel | None) -> Iterator[Row]:
    """Yield the parameters of a contact force, where the loop has one."""
    if contact is None:
        yield "contact", "no contact force: a run ends at the touch"
    else:
        yield from contact.rows()
