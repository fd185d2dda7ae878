"""Whether there is structure left in the residual that nothing explains; of what kind, and where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.mismatch.background import (
    Background,
    Spectrum,
    background,
    seen_in_both,
    seen_rows,
    spectrum,
)
from selector.diagnosis.mismatch.noise_sets import blocks, noise_alone
from selector.diagnosis.mismatch.regimes import Variable, variables
from selector.diagnosis.mismatch.structure_tests import (
    ColumnsOfState,
    Kind,
    Tested,
    burst,
    by_state,
    columns_of_states,
    in_common,
    joined,
    jump,
    largest_of_each_kind,
    of_one_size,
    spectral,
    spells,
    standardised,
)

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
_DRAWS = (99, 199)
"""Sets of noise: the fewest, and as many as there are where readings are not too many."""
_READINGS = 4_000_000
"""Of all sets of a response."""


@dataclass(frozen=True)
class Structure:
    """Something in the residual that is no noise.

    Attributes
    ----------
    kind : {"slow", "line", "cycle", "jump", "state", "burst", "spells", "common"}
        Slower than noise · one frequency · a band of frequencies · a step · by state of the machine · a burst · comes
        and goes in short spells · slow and seen in several responses.
    channel : str
        The response.
    run : str or None
        The run that shows it; None = several.
    from_s, to_s : float or None
        Window [s from the start of that run].
    frequency_hz : (float, float) or None
        The band.
    regime : str or None
        State of the machine in words.
    size : float
        Root mean square of what exceeds noise of short memory [unit of the response].
    unit : str
    p_value : float
        Adjusted for all tests on all responses.
    """

    kind: Kind
    channel: str
    run: str | None
    from_s: float | None
    to_s: float | None
    frequency_hz: tuple[float, float] | None
    regime: str | None
    size: float
    unit: str
    p_value: float


def unexplained(
    comparison: Comparison,
    residuals: Mapping[str, Vector],
    whitened: Mapping[str, Vector],
    *,
    seed: int,
    false_alarm: float,
    wanders: bool = True,
) -> tuple[Structure, ...]:
    """Structure left in residuals, the surest first; empty with probability 1 − `false_alarm` if all is noise.

    A bank of tests (spectrum, common part of two responses, steps, states of the machine, bursts, spells) on every
    response; the largest of all statistics is compared with its distribution over 199 sets (of records beyond 20 000
    samples fewer, 99 at least) of noise that wanders as the residual does, with its own innovations in another order
    (Westfall & Young 1993, single-step maximum).

    Parameters
    ----------
    comparison : Comparison
    residuals : mapping of str to ndarray of shape (n_rows,)
        Response → what is left [its unit]; NaN where missing.
    whitened : mapping of str to ndarray of shape (n_rows,)
        The same after the noise filter; rows that are missing in it are not looked at.
    seed : int
    false_alarm : float
        Probability of any structure where all is noise.
    wanders : bool
        Whether noise may wander slowly. Without, all that is slower than a memory of a few samples is structure.
    """
    rng = np.random.default_rng(seed)
    draws = int(np.clip(_READINGS // len(comparison.time_s), *_DRAWS))
    seen = {name: np.where(np.isfinite(whitened[name]), values, np.nan) for name, values in residuals.items()}
    stacks = noise_alone(comparison, seen, draws, rng, wanders=wanders)
    states = variables(comparison)
    found: list[tuple[str, Tested]] = []
    rows = {response: seen_rows(comparison, seen[response]) for response in stacks}
    noises: dict[str, Background] = {}
    spread: dict[str, float] = {}
    for response, stack in stacks.items():
        tests, noises[response], spread[response] = _tests(stack, rows[response], states, wanders=wanders)
        found += [(response, test) for test in tests]
    for one, other in combinations(stacks, 2):
        both = seen_in_both(rows[one], rows[other])
        if any(len(here) for here in both):
            spectra = (_white_spectrum(stacks[name], both, noises[name]) for name in (one, other))
            pair = in_common(*spectra, wanders=wanders)
            found.append((max((one, other), key=lambda name: _contrast(stacks[name][0])), pair))
    if not found:
        return ()
    scores = np.array([standardised(test.statistic) for _, test in found])
    of_noise = scores[:, 1:].max(axis=0)
    p_values = [_tail(of_noise, float(score)) for score in scores[:, 0]]
    structures = [
        _structure(comparison, response, test, p, stacks[response][0], spread[response])
        for (response, test), p in zip(found, p_values, strict=True)
        if p <= false_alarm
    ]
    return tuple(sorted(structures, key=lambda structure: structure.p_value))


def _tests(
    stack: Matrix,
    rows: Sequence[NDArray[np.intp]],
    states: tuple[Variable, ...],
    *,
    wanders: bool,
) -> tuple[list[Tested], Background, float]:
    """Tests of one response, its noise, and the standard deviation of noise with the memory of its short scales."""
    own = spectrum(stack[:1], rows)
    columns = columns_of_states(background(own, wanders=wanders), rows, states)
    parts, levels = [], []
    for block in blocks(0, len(stack), stack.shape[1]):
        part, noise = _tests_of(stack[block], rows, columns, wanders=wanders)
        parts.append(part)
        levels.append(noise.levels)
    tests = [joined(same) for same in zip(*parts, strict=True)]
    short = background(own, wanders=False)
    spread = float(np.sqrt(short.density(np.linspace(0.001, 0.5, 500))[0].mean()))
    return largest_of_each_kind(tests), Background(np.concatenate(levels)), spread


def _tests_of(
    stack: Matrix,
    rows: Sequence[NDArray[np.intp]],
    states: Sequence[ColumnsOfState],
    *,
    wanders: bool,
) -> tuple[list[Tested], Background]:
    of = spectrum(stack, rows)
    noise = background(of, wanders=wanders)
    tests = spectral(of, np.abs(of.amplitudes) ** 2 / noise.density(of.frequency))
    seen = np.concatenate(rows)
    white = noise.innovations(stack, rows)
    white /= 1.4826 * np.median(np.abs(white[:, seen]), axis=1, keepdims=True) + 1e-300
    clipped = np.clip(white, -4.0, 4.0)
    even = of_one_size(white, rows, states)
    tests += [*jump(clipped, noise, rows), *by_state(clipped, rows, states), *burst(even, rows)]
    return [*tests, *spells(stack, even, rows)], noise


def _white_spectrum(stack: Matrix, rows: Sequence[NDArray[np.intp]], noise: Background) -> Spectrum:
    of = spectrum(stack, rows)
    return Spectrum(of.frequency, of.run, of.amplitudes / np.sqrt(noise.density(of.frequency)))


def _contrast(residual: Vector) -> float:
    """How much larger a residual is than its changes from sample to sample."""
    return float(np.std(residual) / max(float(np.median(np.abs(np.diff(residual[residual != 0.0])))), 1e-300))


def _tail(of_noise: Vector, score: float) -> float:
    """Share of noise that reaches a score; beyond the highest tenth an exponential tail."""
    start = float(np.quantile(of_noise, 0.9))
    if score <= start:
        return float((1 + np.sum(of_noise >= score)) / (1 + len(of_noise)))
    beyond = of_noise[of_noise > start] - start
    return float(max(0.1 * np.exp(-(score - start) / max(float(beyond.mean()), 1e-12)), 1e-12))


def _structure(
    comparison: Comparison, response: str, test: Tested, p_value: float, residual: Vector, spread: float
) -> Structure:
    run = None if test.run is None else comparison.runs[test.run]
    window = None if test.rows is None else (comparison.time_s[test.rows[0]], comparison.time_s[test.rows[1]])
    seen = residual[residual != 0.0]
    if test.rows is not None:
        seen = residual[test.rows[0] : test.rows[1] + 1]
    band = None if test.frequency is None else tuple(f / comparison.period_s for f in test.frequency)
    return Structure(
        kind=test.kind,
        channel=response,
        run=run,
        from_s=None if window is None else float(window[0]),
        to_s=None if window is None else float(window[1]),
        frequency_hz=band,  # type: ignore[arg-type]
        regime=test.words,
        size=float(np.sqrt(max(float(np.mean(seen**2)) - spread**2, 0.0))),
        unit=comparison.channel(response).unit,
        p_value=p_value,
    )
