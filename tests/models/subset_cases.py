"""Regression problems for the subset search, and the answers by brute force."""

from __future__ import annotations

import itertools

import numpy as np


def warm_machine(n_samples, n_columns, seed, noise_k=0.05, noise_um=1.0):
    """Sensors that follow a few heat sources through first-order lags: strongly collinear, and a sparse response."""
    rng = np.random.default_rng(seed)
    load = np.repeat(rng.random((n_samples // 20 + 1, 3)) > 0.5, 20, axis=0)[:n_samples].astype(float)
    columns = np.empty((n_samples, n_columns))
    for j in range(n_columns):
        target = load @ rng.uniform(0.0, 6.0, 3)
        gain = 1.0 / rng.uniform(10.0, 60.0)
        level = 0.0
        for i, goal in enumerate(target):
            level += gain * (goal - level)
            columns[i, j] = level
    columns += noise_k * rng.normal(size=columns.shape)
    weights = np.zeros(n_columns)
    active = rng.permutation(n_columns)[:4]
    weights[active] = rng.uniform(1.0, 4.0, len(active))
    return columns, columns @ weights + noise_um * rng.normal(size=n_samples)


def rss_by_least_squares(columns, response):
    """Residual sum of squares by an orthogonal decomposition of the samples, also for dependent columns."""
    length = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(length > 0.0, length, 1.0)
    coefficients = np.linalg.lstsq(scaled, response, rcond=1e-7)[0]
    rest = response - scaled @ coefficients
    return float(rest @ rest)


def every_rss(columns, response, size, allowed=lambda chosen: True):
    """RSS of every allowed set of one size, ascending; columns and response as they enter the regression."""
    p = columns.shape[1]
    sets = (chosen for chosen in itertools.combinations(range(p), size) if allowed(chosen))
    return sorted(rss_by_least_squares(columns[:, list(chosen)], response) for chosen in sets)


def best_rss_of_every_size(cross):
    """The smallest RSS of every size by solving all 2^p systems, for independent columns."""
    gram, response, total = cross[:-1, :-1], cross[:-1, -1], cross[-1, -1]
    best = {}
    for size in range(1, len(response) + 1):
        sets = np.array(list(itertools.combinations(range(len(response)), size)))
        systems = gram[sets[:, :, None], sets[:, None, :]]
        right = response[sets]
        explained = np.einsum("ij,ij->i", right, np.linalg.solve(systems, right[..., None])[..., 0])
        best[size] = float(total - explained.max())
    return best
