"""Seeded samples of inputs that are not known exactly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray

from .correlated import CorrelatedNormal
from .distributions import Distribution

__all__ = ["MOST_SAMPLES", "SAMPLINGS", "Uncertainty", "check_draw", "names_of", "sample_inputs"]

Uncertainty: TypeAlias = Mapping[str, Distribution | CorrelatedNormal]
"""What is known of inputs, by name, such as `obstacle.velocity`; under a free name, of several that go together."""

SAMPLINGS: Final = ("sobol", "latin-hypercube", "random")

MOST_SAMPLES: Final = 1_000_000
"""How many samples are drawn at once."""


def names_of(uncertainty: Uncertainty) -> tuple[str, ...]:
    """Return the names of the inputs, each once.

    Args:
        uncertainty: what is known of them.

    Returns:
        The names, in order.

    Raises:
        InvalidInputError: there is none, or one is named twice.
    """
    names: list[str] = []
    for name, known in uncertainty.items():
        names += known.names if isinstance(known, CorrelatedNormal) else (name,)
    if not names:
        raise InvalidInputError('uncertainty: found none, expected inputs such as {"obstacle.velocity": Uniform(...)}')
    for name in names:
        if names.count(name) > 1:
            raise InvalidInputError(f"uncertainty: found {name} twice, expected every input once")
    return tuple(names)


def sample_inputs(
    uncertainty: Uncertainty, count: int, *, seed: int = 0, sampling: str = "sobol"
) -> dict[str, FloatArray]:
    """Draw samples of inputs, the same for the same seed on every machine.

    Args:
        uncertainty: what is known of them; inputs that are not correlated are independent.
        count: how many samples.
        seed: of NumPy's generator.
        sampling: "sobol" (scrambled Sobol sequence: what it averages converges faster than 1/sqrt(n)),
            "latin-hypercube", or "random" (independent samples, for which confidence intervals hold).

    Returns:
        The samples by input, shape (count,) each.

    Examples:
        >>> from pretouch.uncertainty import Uniform
        >>> drawn = sample_inputs({"obstacle.velocity": Uniform(low=-0.4, high=-0.2)}, 1024)
        >>> bool(abs(drawn["obstacle.velocity"].mean() + 0.3) < 1e-3)
        True
    """
    names_of(uncertainty)
    check_draw(count, seed=seed, sampling=sampling)
    widths = [len(known.names) if isinstance(known, CorrelatedNormal) else 1 for known in uncertainty.values()]
    points = _points(count, sum(widths), seed, sampling)
    found: dict[str, FloatArray] = {}
    at = 0
    for (name, known), width in zip(uncertainty.items(), widths, strict=True):
        part = points[:, at : at + width]
        at += width
        if isinstance(known, CorrelatedNormal):
            from scipy.special import ndtri  # noqa: PLC0415 - SciPy, only when something is sampled

            drawn = np.asarray(known.mean) + ndtri(part) @ known.root.T
            found |= {member: np.ascontiguousarray(drawn[:, i]) for i, member in enumerate(known.names)}
        else:
            found[name] = known.quantile(part[:, 0])
    return found


def check_draw(count: int, *, seed: int, sampling: str) -> None:
    """Refuse numbers of samples, seeds and ways of sampling that make no sense; arguments as in `sample_inputs`."""
    if sampling not in SAMPLINGS:
        raise InvalidInputError(f"sampling: found {sampling!r}, expected one of {', '.join(SAMPLINGS)}")
    if type(count) is not int or count < 1:
        raise InvalidInputError(f"samples: found {count!r}, expected a positive whole number")
    if count > MOST_SAMPLES:
        raise InvalidInputError(
            f"samples: found {count:,}, expected at most {MOST_SAMPLES:,}: the error of a sample falls with the square "
            "root of its size, and that of the model does not"
        )
    if type(seed) is not int or seed < 0:
        raise InvalidInputError(f"seed: found {seed!r}, expected a whole number that is not negative")


def _points(count: int, dimensions: int, seed: int, sampling: str) -> FloatArray:
    """Return points of the open unit cube."""
    rng = np.random.default_rng(seed)
    if sampling == "random":
        points = rng.random((count, dimensions))
    else:
        from scipy.stats import qmc  # noqa: PLC0415 - half a second to load, only when something is sampled

        if sampling == "sobol":  # a power of two is what its balance is proved for
            points = qmc.Sobol(dimensions, rng=rng).random_base2(max(count - 1, 0).bit_length())[:count]
        else:
            points = qmc.LatinHypercube(dimensions, rng=rng).random(count)
    return np.asarray(np.clip(points, 2.0**-54, 1 - 2.0**-53))
