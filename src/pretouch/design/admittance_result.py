"""What the design of gain and admittance comes to, why it is believed to be the best, and what it says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

from pretouch._core.blocks import Cell, Chapter, Measured, Page, Paragraph, Picture, Rows
from pretouch._core.errors import ResultUnavailableError
from pretouch._core.files import plain
from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch._core.values import Value
from pretouch.motion import Admittance, Scenario

from .certificate import DesignStatus
from .gain import GainDesign
from .page import gain_page
from .problem import Answer


@dataclass(frozen=True, slots=True, kw_only=True)
class AdmittanceMinimum(Value):
    """A local minimum over gain and admittance.

    Args:
        gain: D_p [N s].
        natural_frequency: sqrt(K_a / M_a) [rad/s].
        damping_ratio: D_a / (2 sqrt(M_a K_a)).
        objective: the objective there.
        at: its coordinates within the bounds, each in [0, 1].
    """

    gain: float
    natural_frequency: float
    damping_ratio: float
    objective: float
    at: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class AdmittanceCertificate(Value):
    """Why a design of gain and admittance is believed to be the global optimum within the bounds.

    Args:
        grid: how many encounters the grid over all that is free has.
        tests: how many further encounters, none of which is better, had no part in the search.
        local_minima: the minima that were found, best first.
        residual: what remains of the gradient of the objective, over the objective, by coordinates that go from 0 to 1
            between the bounds, when the active limits and bounds are balanced: the first-order conditions of
            Karush, Kuhn and Tucker.
        active: the limits and bounds that hold the optimum, each with its multiplier: by how much of itself the
            objective falls per unit by which it is relaxed (of a limit: of itself; of a bound: of the range).
    """

    grid: int
    tests: int
    local_minima: tuple[AdmittanceMinimum, ...]
    residual: float
    active: tuple[tuple[str, float], ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the certificate as one JSON object."""
        active = [{"name": name, "multiplier": multiplier} for name, multiplier in self.active]
        names = ("grid", "tests", "residual", "local_minima")
        return {**{name: getattr(self, name) for name in names}, "active": active}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class AdmittanceMap(Value):
    """The best objective over the gains, for each admittance of the grid.

    Args:
        natural_frequency: [rad/s], of the shape of the grid over what is free.
        damping_ratio: likewise.
        objective: likewise; infinite where no gain that was tried will do.
    """

    natural_frequency: FloatArray
    damping_ratio: FloatArray
    objective: FloatArray

    def __repr__(self) -> str:
        return f"<AdmittanceMap: {self.objective.size} admittances>"


@dataclass(frozen=True, kw_only=True, repr=False)
class AdmittanceDesign(Answer):
    """What `design_admittance` returns.

    Args:
        problem: the task, and the gains between which the optimum was sought.
        status: optimal, infeasible or no-contact.
        free: what was chosen: `gain` and `natural_frequency`, `damping_ratio` or both.
        natural_frequency_bounds: between which it was sought [rad/s]; None where it is not free.
        damping_ratio_bounds: likewise; None where it is not free.
        gain_design: the design of the gain at the chosen admittance, with its evidence; None unless optimal.
        as_it_is: the design of the gain with the admittance of the scenario.
        certificate: why it is believed to be the optimum; None unless optimal.
        map: the best objective over admittances.
        best_ratio: where infeasible, |quantity| / limit of the worst limit at the best encounter of the grid, or None.
    """

    status: DesignStatus
    free: tuple[str, ...]
    natural_frequency_bounds: tuple[float, float] | None
    damping_ratio_bounds: tuple[float, float] | None
    gain_design: GainDesign | None
    as_it_is: GainDesign
    certificate: AdmittanceCertificate | None
    map: AdmittanceMap
    best_ratio: float | None

    page: ClassVar[str] = "pretouch.design.admittance_result:admittance_page"

    @property
    def gain(self) -> float | None:
        """The optimal gain D_p [N s]; None unless optimal."""
        return None if self.gain_design is None else float(self.gain_design.gain)

    @property
    def objective(self) -> float | None:
        """The objective at the optimum; None unless optimal."""
        return None if self.gain_design is None else float(self.gain_design.objective)

    @property
    def scenario(self) -> Scenario:
        """The encounter with the optimal admittance; that which was given unless optimal."""
        return self.problem.task.scenario if self.gain_design is None else self.gain_design.scenario

    @property
    def admittance(self) -> Admittance:
        """The optimal admittance.

        Raises:
            ResultUnavailableError: there is no optimum; `status` says why.
        """
        if self.gain_design is None:
            raise ResultUnavailableError(f"admittance: found a design that is {self.status.value}, which has none")
        return self.gain_design.scenario.admittance

    @property
    def natural_frequency(self) -> float | None:
        """The optimal natural frequency [rad/s]; None unless optimal."""
        return None if self.certificate is None else self.certificate.local_minima[0].natural_frequency

    @property
    def damping_ratio(self) -> float | None:
        """The optimal damping ratio; None unless optimal."""
        return None if self.certificate is None else self.certificate.local_minima[0].damping_ratio

    def to_dict(self) -> dict[str, Any]:
        """Return the design as one JSON object: that of the gain, with `admittance` beside it."""
        names = ("free", "natural_frequency", "damping_ratio", "natural_frequency_bounds", "damping_ratio_bounds")
        chosen = None if self.gain_design is None else self.admittance
        told = {
            **{name: getattr(self, name) for name in (*names, "best_ratio")},
            **{name: getattr(chosen, name, None) for name in ("mass", "damping", "stiffness")},
            "as_it_is": {"gain": self.as_it_is.gain, "objective": self.as_it_is.objective},
            "certificate": self.certificate,
            "map": {f.name: getattr(self.map, f.name).reshape(-1) for f in fields(self.map)},
        }
        found = (self.gain_design or self.as_it_is).to_dict()
        return {**found, "status": self.status.value, "admittance": plain(told)}

    @property
    def headline(self) -> str:
        """The answer in a sentence."""
        if self.gain_design is None or self.objective is None:
            if self.status is DesignStatus.NO_CONTACT:
                return "No gain and admittance within the bounds end in contact."
            missed = (
                "" if self.best_ratio is None else f"; at best one is exceeded by {100 * (self.best_ratio - 1):.3g} %"
            )
            return f"Infeasible: no gain and admittance within the bounds meet every constraint{missed}."
        a = self.admittance
        text = (
            f"Optimal admittance: natural frequency {format_quantity(self.natural_frequency or 0.0, 'rad/s')}, damping "
            f"ratio {self.damping_ratio:.4g} (damping {format_quantity(a.damping, 'N*s/m')}, stiffness "
            f"{format_quantity(a.stiffness, 'N/m')}) with {self.number.equals(self.gain or 0.0)}: "
            f"objective {self.objective:.4g}"
        )
        if self.as_it_is.objective is not None:
            change = 100 * (self.objective / self.as_it_is.objective - 1)
            than = f"{abs(change):.3g} % {'less' if change < 0 else 'more'} than"
            return f"{text}, {than} the {self.as_it_is.objective:.4g} of the admittance as it is."
        return f"{text}; with the admittance as it is no gain would do."


Row = tuple[Cell, ...]


def admittance_page(design: AdmittanceDesign) -> Page:
    """Describe a design of any status: the page of its gain, at the chosen admittance or as it is, after its own."""
    chosen = design.gain_design is not None
    page = gain_page(design.gain_design or design.as_it_is)
    head = ("", "natural frequency", "damping ratio", design.number.label, "objective")
    evidence = tuple(_evidence(design))
    follows = Paragraph(
        text=f"{'At this admittance' if chosen else 'With the admittance as it is'}: {page.headline}", brief=True
    )
    picture = Picture(
        figure="admittance",
        of=design,
        name="Best objective over the admittance",
        caption="The best objective over the gains, for the admittances of the search grid; the chosen point is the "
        "minimum that was found from there.",
    )
    own = Chapter(
        title="The admittance",
        blocks=(
            Rows(head=head, rows=tuple(_rows(design)), brief=True),
            picture if design.certificate is not None else None,
            Rows(rows=evidence, wraps=True, brief=True) if evidence else None,
            follows,
        ),
    )
    return replace(page, headline=design.headline, good=chosen, blocks=(own, *page.blocks))


def _rows(design: AdmittanceDesign) -> Iterator[Row]:
    for i, m in enumerate(() if design.certificate is None else design.certificate.local_minima):
        cells = (Measured(m.damping_ratio), Measured(m.gain, design.number.unit), Measured(m.objective))
        yield "local minimum" if i else "chosen", Measured(m.natural_frequency, "rad/s"), *cells
    before = design.as_it_is
    own = before.scenario.admittance
    ratio = Measured(float(own.damping_ratio) if own.stiffness > 0 else None)
    cells = (ratio, Measured(before.gain, design.number.unit), Measured(before.objective))
    yield "as it is", Measured(float(own.natural_frequency), "rad/s"), *cells


def _evidence(design: AdmittanceDesign) -> Iterator[Row]:
    c = design.certificate
    if c is None:
        return
    held = ", ".join(f"{name.replace('_', ' ')} (multiplier {value:.3g})" for name, value in c.active)
    yield "searched", f"{c.grid} encounters on a grid; none of {c.tests} others is better than what was found"
    yield "the optimum is held by", held or "nothing: it lies inside"
    yield "first-order residual, of the objective", f"{c.residual:.1e}"
