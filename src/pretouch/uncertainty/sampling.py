"""Seeded samples of inputs that are not known exactly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, TypeAlias

import numpy as np

from pretouch._core.errors import InvalidInputError
from pretouch._core.numbers import FloatArray

from .distributions import JointDistribution

__all__ = ["MOST_SAMPLES", "SAMPLINGS", "Uncertainty", "check_draw", "names_of", "sample_inputs"]

Uncertainty: TypeAlias = Mapping[str, JointDistribution]
"""What is known of inputs, by name, such as `obstacle.velocity`; under a free name, of several that go together."""

SAMPLINGS: Final = ("sobol", "latin-hypercube", "random")

MOST_SAMPLES: Final = 1_000_000
"""How many samples are drawn at once."""


def names_of(uncertainty: Uncertainty) -> tuple[str, ...]:
    """Return the names of the inputs, in order; refuse an uncertainty of none, or one that names an input twice."""
    for name, known in uncertainty.items():
        if not isinstance(known, JointDistribution):
            raise InvalidInputError(
                f"uncertainty {name}: found {type(known).__name__}, expected a distribution, such as a Uniform, "
                "or a class of your own that inherits from pt.robust.Distribution and defines support and _quantile"
            )
    names = [member for name, known in uncertainty.items() for member in known.inputs(name)]
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

    Raises:
        InvalidInputError: a request makes no sense, or a distribution does not draw one of each input for each point.

    Examples:
        >>> from pretouch.uncertainty import Uniform
        >>> drawn = sample_inputs({"obstacle.velocity": Uniform(low=-0.4, high=-0.2)}, 1024)
        >>> bool(abs(drawn["obstacle.velocity"].mean() + 0.3) < 1e-3)
        True
    """
    names = names_of(uncertainty)
    check_draw(count, seed=seed, sampling=sampling)
    points, at = _points(count, len(names), seed, sampling), 0
    found: dict[str, FloatArray] = {}
    for name, known in uncertainty.items():
        members = known.inputs(name)
        drawn = np.asarray(known.draw(points[:, at : at + len(members)]))
        if drawn.shape != (count, len(members)):
            raise InvalidInputError(
                f"uncertainty {name}: found samples of shape {drawn.shape} from {type(known).__name__}, expected "
                f"{(count, len(members))}: one of each of its inputs for each point"
            )
        at += len(members)
        found |= {member: np.ascontiguousarray(drawn[:, i]) for i, member in enumerate(members)}
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
