"""The pedestal under the signal, the noise above it, and readings that fit no curve: known before any model is ranked.

Where the offset is not given it is fitted together with the inverse power, which contains the exponential as a limit,
to all readings from the first usable distance outwards, in the domain of the output: there the far field, where ln is
meaningless, says most about the offset.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pretouch._core.numbers import FloatArray

from .averaging import AveragedCurve, ReadingNoise
from .families import InversePowerFamily
from .least_squares import Residuals, Solution, gradient, interval, minimize
from .result import NoiseEstimate, OffsetEstimate

__all__ = ["Baseline", "estimate_baseline"]

_STEEPEST_KAPPA = 0.5  # 1 / n: far from a source of finite size the light returned falls at least as 1 / l^2
_EXPONENTIAL_KAPPA = 1e-6  # an exponential to 1e-5 over five of its lengths, for the most precise of readings
_TYPICAL_JITTER = 0.03  # a positioning error of 0.4 mm where the slope is 80 1/m
_JITTER_SPREAD = 0.7  # of its logarithm: from 0.75 to 12 % at two standard deviations
_SMALLEST_JITTER = 1e-4  # nothing is known better than that; exact numbers are weighed as their logarithms
_LARGEST_JITTER = 0.3  # beyond, any curve passes for a pedestal far below the readings
_RATIOS = np.geomspace(2.0, 1 / 400, 8)  # of sigma / sigma_rel to the largest signal; the steadiest fit first
_OUTLIER_LEVEL = 0.02  # chance of flagging a point of a curve that has no outlier
_NEGLIGIBLE_MISS = 1e-4  # of the largest signal: no bad reading, however exact all others are
_SMALLEST = 1e-9  # of the largest signal: exact numbers are fitted as if they had this noise


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Baseline:
    """What all models of a ranking have in common: offset, noise, and which distances to leave out."""

    offset: OffsetEstimate
    noise: NoiseEstimate
    outliers: tuple[int, ...]
    family: InversePowerFamily
    u: FloatArray

    def shape_at(self, distance: float) -> tuple[float, float, float]:
        """Return ln xi, its slope and its second derivative at a distance, for models to start from."""
        slope = self.family.slope(self.u, distance)
        log_output = float(self.family.log_output(self.u, np.array([distance]))[0])
        return log_output, slope, float(self.u[2]) * slope**2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _State:
    """One fit of curve and offset: minimum, signal there, and the two parts of the noise."""

    solution: Solution
    signal: FloatArray
    sigma: float
    jitter: float
    deviance: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Problem:
    """The inverse power plus offset on some points; `offset` is None where it is fitted, `sigma` where unknown."""

    curve: AveragedCurve
    family: InversePowerFamily
    offset: float | None
    sigma: float | None
    floor: float

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        low, high = self.family.bounds
        if self.offset is None:
            y = self.curve.output
            reach = float(np.ptp(y))
            low, high = np.append(low, y.min() - reach), np.append(high, y.max())
        return low, high

    def offset_of(self, x: FloatArray) -> float:
        return float(x[3]) if self.offset is None else self.offset

    def signal(self, x: FloatArray) -> FloatArray:
        log_output = self.family.log_output(x[:3], self.curve.distance)
        ceiling = np.log(float(np.abs(self.curve.output).max()) + 1e-300) + 30  # trial steps may go anywhere
        return np.asarray(np.exp(np.minimum(log_output, ceiling)))

    def residuals(self, variance: FloatArray) -> Residuals:
        weight = 1 / np.sqrt(variance)
        return lambda x: (self.curve.output - self.offset_of(x) - self.signal(x)) * weight

    def start(self) -> FloatArray:
        d, y = self.curve.distance, self.curve.output
        reach = float(np.ptp(y)) or max(abs(float(y[0])), 1.0)
        guess = float(y.min() - 0.02 * reach) if self.offset is None else self.offset
        xi = np.maximum(y - guess, 0.01 * reach)
        log_middle = float(np.interp(self.family.middle, d, np.log(xi)))
        third = max(2, len(d) // 3)
        steep = min(float(np.polyfit(d[:third], np.log(xi[:third]), 1)[0]), -0.1 / self.family.span)
        u = self.family.start(log_middle, 0.6 * steep, 0.3 * (0.6 * steep) ** 2)
        u[1] = -np.log(-steep)
        u = np.clip(u, *self.family.bounds)  # beyond, a curve may end within the window
        return np.append(u, guess) if self.offset is None else u


def estimate_baseline(curve: AveragedCurve, known: ReadingNoise, offset: OffsetEstimate | None) -> Baseline:
    """Estimate offset (where it is not given), noise and outliers of an averaged curve.

    Args:
        curve: the averaged curve from the first usable distance outwards, at least four points.
        known: noise of a reading from repeats and no-object readings, where these tell.
        offset: the offset where it is measured or declared; None to fit it.

    Returns:
        The baseline; `outliers` are indices into the curve.
    """
    reach = max(float(np.ptp(curve.output)), 1e-12 * float(np.abs(curve.output).max()), 1e-300)
    floor = max(known.resolution / np.sqrt(12.0), _SMALLEST * reach)
    problem = _Problem(
        curve=curve,
        family=InversePowerFamily(
            first=float(curve.distance[0]),
            last=float(curve.distance[-1]),
            kappa_max=_STEEPEST_KAPPA if offset is None else 10.0,
            kappa_floor=_EXPONENTIAL_KAPPA,
        ),
        offset=None if offset is None else offset.value,
        sigma=known.sigma,
        floor=floor,
    )
    outliers: list[int] = []
    state = _fit(problem, robust=True)
    kept = np.arange(len(curve.distance))
    while len(outliers) < max(1, len(curve.distance) // 6):
        worst = _worst(problem, state)
        if worst is None:
            break
        outliers.append(int(kept[worst]))
        kept = np.delete(kept, worst)
        mask = np.isin(np.arange(len(curve.distance)), kept)
        problem = replace(problem, curve=curve.part(mask))
        state = _fit(problem, robust=True)
    state = _fit(problem, robust=False)
    noise = _noise(state, known, problem)
    if offset is None:
        offset = _fitted_offset(problem, state)
    return Baseline(
        offset=offset,
        noise=noise,
        outliers=tuple(sorted(outliers)),
        family=problem.family,
        u=state.solution.x[:3],
    )


def _fit(problem: _Problem, *, robust: bool) -> _State:
    """Fit at several ratios of output noise to relative jitter, and take the likeliest."""
    reach = float(np.ptp(problem.curve.output)) or 1.0
    x = problem.start()
    best: _State | None = None
    for ratio in _RATIOS:
        state = _fit_at(problem, ratio * reach, x, robust=robust)
        if best is None or state.deviance < best.deviance:
            best = state
        elif state.deviance > best.deviance + 12:
            break
        x = state.solution.x
    if best is None:  # there are always ratios to try
        raise AssertionError
    return best


def _fit_at(problem: _Problem, ratio: float, start: FloatArray, *, robust: bool, rounds: int = 5) -> _State:
    """Iterate fit and weights 1 / (tau^2 / n + xi^2), tau = sigma / sigma_rel, to their fixed point."""
    count, x = problem.curve.count, start
    signal, size = problem.signal(x), 0.0
    solution: Solution | None = None
    for _ in range(rounds):
        shape = ratio**2 / count + signal**2
        known = problem.sigma / ratio if problem.sigma is not None else size
        loss = 2.0 * known if robust and known else None
        solution = minimize(problem.residuals(shape), x, problem.bounds, tolerance=1e-9, robust=loss, evaluations=30)
        dof = max(len(count) - len(x), 1)
        size = float(np.sqrt(solution.cost / dof))
        if robust:
            size = _robust_size(solution.residuals, dof)
        settled = np.allclose(solution.x, x, rtol=1e-7, atol=1e-9)
        x = solution.x
        signal = np.sqrt(signal * np.maximum(problem.signal(x), 1e-30)) if not settled else problem.signal(x)
        if settled:
            break
    if solution is None:  # there is always a round
        raise AssertionError
    signal = problem.signal(x)
    shape = ratio**2 / count + signal**2
    solution = replace(solution, residuals=problem.residuals(shape)(x))
    return _state(problem, solution, signal, ratio, shape)


def _robust_size(residuals: FloatArray, dof: int) -> float:
    """Return Huber's scale of residuals: squares count at most as those at two standard deviations."""
    square = residuals**2
    variance = float(square.sum()) / dof
    for _ in range(20):
        variance = float(np.minimum(square, 4 * variance).sum()) / (0.92 * dof)  # 0.92 for a normal distribution
    return float(np.sqrt(variance))


def _state(problem: _Problem, solution: Solution, signal: FloatArray, ratio: float, shape: FloatArray) -> _State:
    """Weigh a fit by its restricted likelihood, with a weak prior on the relative jitter."""
    dof = max(len(signal) - len(solution.x), 1)
    cost = max(solution.cost, (_SMALLEST * float(np.ptp(problem.curve.output)) / ratio) ** 2 * dof)
    information = np.linalg.svd(solution.jacobian, compute_uv=False)
    volume = 2 * float(np.log(np.maximum(information, 1e-6 * information[0] + 1e-300)).sum())
    deviance = float(np.log(shape).sum()) + volume
    jitter = max(float(np.sqrt(cost / dof)), problem.floor / ratio, _SMALLEST_JITTER)
    if problem.sigma is not None:
        jitter = problem.sigma / ratio
    deviance += 2 * dof * np.log(jitter) + cost / jitter**2
    deviance += float(np.log(jitter / _TYPICAL_JITTER) / _JITTER_SPREAD) ** 2
    deviance += 1e6 * max(jitter - _LARGEST_JITTER, 0.0)
    return _State(solution=solution, signal=signal, sigma=ratio * jitter, jitter=jitter, deviance=deviance)


def _worst(problem: _Problem, state: _State) -> int | None:
    """Find the point that a fit to all others predicts worst, if it lies beyond what chance allows (Bonferroni).

    The nearest point is never judged: nothing confirms the curve there.

    Returns:
        Its index; None where chance allows all of them.
    """
    from scipy.special import stdtr  # noqa: PLC0415 - SciPy is loaded only for fits

    d, y, count = problem.curve.distance, problem.curve.output, problem.curve.count
    dof = len(d) - 1 - len(state.solution.x)
    if dof < 2:
        return None
    scale = np.sqrt(state.sigma**2 / count + (state.jitter * state.signal) ** 2)
    order = np.argsort(-np.abs(y - problem.offset_of(state.solution.x) - state.signal) / scale)
    smallest, worst = _OUTLIER_LEVEL / len(d), None
    negligible = _NEGLIGIBLE_MISS * float(state.signal.max())
    for i in [int(k) for k in order if k > 0][:3]:
        part = replace(problem, curve=problem.curve.part(np.arange(len(d)) != i))
        fit = _fit_at(part, state.sigma / state.jitter, state.solution.x, robust=False, rounds=2)
        at = d[[i]]

        def predicted(x: FloatArray, at: FloatArray = at) -> FloatArray:
            return problem.offset_of(x) + np.exp(problem.family.log_output(x[:3], at))

        x = fit.solution.x
        signal = float(np.exp(problem.family.log_output(x[:3], at))[0])
        sensitivity = gradient(predicted, x)[0]
        variance = fit.sigma**2 / count[i] + (fit.jitter * signal) ** 2
        variance += fit.jitter**2 * float(sensitivity @ fit.solution.covariance @ sensitivity)
        miss = abs(float(y[i] - predicted(x)[0]))
        chance = 2 * float(stdtr(dof, -miss / np.sqrt(variance)))
        if chance < smallest and miss > negligible:
            smallest, worst = chance, i
    return worst


def _noise(state: _State, known: ReadingNoise, problem: _Problem) -> NoiseEstimate:
    if known.sigma is not None:
        source = known.source
    elif state.sigma <= 1.01 * known.resolution / np.sqrt(12.0):
        source = "quantization (the fit scatters less)"
    else:
        source = "scatter about the fitted curve"
    return NoiseEstimate(
        output=max(state.sigma, problem.floor),
        relative=state.jitter,
        resolution=known.resolution,
        output_source=source,
        relative_source="scatter about the fitted curve",
    )


def _fitted_offset(problem: _Problem, state: _State) -> OffsetEstimate:
    """Profile the offset at the final weights; the exponent may be anything from 2 to infinity."""
    from scipy.special import stdtrit  # noqa: PLC0415 - SciPy is loaded only for fits

    count = problem.curve.count
    variance = state.sigma**2 / count + (state.jitter * state.signal) ** 2
    residuals = problem.residuals(variance)
    best = minimize(residuals, state.solution.x, problem.bounds)
    dof = max(len(count) - len(best.x), 1)
    quantile = float(stdtrit(dof, 0.975))
    low, high, _, _ = interval(residuals, best, problem.bounds, lambda x: float(x[3]), quantile**2)
    value = float(best.x[3])
    return OffsetEstimate(
        value=value,
        standard_error=(high - low) / (2 * quantile),
        low=min(low, value),
        high=max(high, value),
        kind="fitted",
    )
