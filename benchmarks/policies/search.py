"""Minimize a function of several numbers by CMA-ES, the evolution strategy with an adapted covariance matrix.

The equations are those of N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772, with weights >= 0.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Array = np.ndarray


def minimize(
    function: Callable[[Array], Array], start: Array, step: float, generations: int, rng: np.random.Generator
) -> Array:
    """Return the mean of the search distribution after the last generation.

    Args:
        function: values of the candidates, an array (k, n) with a row per candidate.
        start: first mean, shape (n,).
        step: first standard deviation of every number.
        generations: number of calls of the function.
        rng: source of the random numbers.

    Returns:
        The numbers, shape (n,).
    """
    n = len(start)
    size = 4 + int(3 * np.log(n))
    weights = np.log(size / 2 + 0.5) - np.log(np.arange(1, size // 2 + 1))
    weights /= weights.sum()
    selected = 1 / np.sum(weights**2)  # mu_eff
    path_rate = (4 + selected / n) / (n + 4 + 2 * selected / n)
    step_rate = (selected + 2) / (n + selected + 5)
    rank_one = 2 / ((n + 1.3) ** 2 + selected)
    rank_mu = min(1 - rank_one, 2 * (selected - 2 + 1 / selected) / ((n + 2) ** 2 + selected))
    damping = 1 + 2 * max(0.0, np.sqrt((selected - 1) / (n + 1)) - 1) + step_rate
    length = np.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2))  # mean length of a standard normal vector
    mean, covariance, sigma = np.array(start, dtype=float), np.eye(n), step
    path, step_path = np.zeros(n), np.zeros(n)
    for generation in range(1, generations + 1):
        values, axes = np.linalg.eigh(covariance)
        widths = np.sqrt(np.maximum(values, 1e-20))
        moves = rng.standard_normal((size, n)) * widths @ axes.T
        best = moves[np.argsort(function(mean + sigma * moves))[: len(weights)]]
        move = weights @ best
        mean = mean + sigma * move
        step_path = (1 - step_rate) * step_path + np.sqrt(step_rate * (2 - step_rate) * selected) * (
            axes @ (axes.T @ move / widths)
        )
        unbiased = np.linalg.norm(step_path) / np.sqrt(1 - (1 - step_rate) ** (2 * generation))
        steady = unbiased < (1.4 + 2 / (n + 1)) * length
        path = (1 - path_rate) * path + steady * np.sqrt(path_rate * (2 - path_rate) * selected) * move
        covariance = (
            (1 - rank_one - rank_mu) * covariance
            + rank_one * np.outer(path, path)
            + rank_mu * (best.T * weights) @ best
        )
        sigma *= np.exp(step_rate / damping * (np.linalg.norm(step_path) / length - 1))
    return mean
