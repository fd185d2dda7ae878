"""What a user should know about fitted thermal modes, in words."""

from collections.abc import Iterator, Sequence

import numpy as np

from selector.findings import Finding, Where
from selector.physics.thermal.finding_table import FINDINGS
from selector.physics.thermal.modes.fit import Fit
from selector.physics.thermal.modes.thermal_test import ModeData, ThermalTest
from selector.types import Vector

NEAR = 1.7
"""Neighbouring time constants below this ratio look like one in most records."""


def choice_findings(
    tests: Sequence[ThermalTest],
    data: ModeData,
    fit: Fit,
    tried: Sequence[tuple[Fit, Vector]],
    tau_low_s: Vector,
    tau_high_s: Vector,
    heldout_um: Vector,
    responses: Sequence[str],
) -> Iterator[Finding]:
    """Findings on the number of modes, their certainty, speeds, film and starts."""
    yield from _number_of_modes(fit, data, tried)
    yield from loose_findings(fit.tau_s, data, tau_low_s, tau_high_s)
    yield from _speeds(fit, data)
    if fit.spec.film == "growing":
        growth = float(np.trace(np.diag(np.exp(fit.theta[: fit.spec.n_modes])) @ fit.spec.films(fit.theta)[0]))
        yield FINDINGS.finding(
            "cooling-grows-with-speed",
            "The machine cools better while the spindle turns: with constant time constants the tests are predicted "
            "worse. The time constants given are those of the standing spindle. How much better is less certain than "
            "they are: duty cycles with pauses may be off by several times the error on what was left out.",
            evidence={"growth_at_fastest": round(growth, 3), "exponent": round(fit.spec.films(fit.theta)[2], 2)},
        )
    for run in fit.spec.free_starts:
        begin, end = data.bounds[run]
        turning = bool((data.speed_rpm[begin:end] > 0.01 * data.fastest_rpm).any())
        yield FINDINGS.finding(
            "start-not-at-rest",
            f"Run {tests[run].run} does not begin at rest and cold"
            + (": only a start of its own explains it." if turning else ": the spindle never turns in it.")
            + " The state at its start was fitted too, so it says less about the steady levels.",
            Where(run=tests[run].run),
            suggestion="let the machine rest until it is cold before a heating test" if turning else "",
            level="warning" if turning else "info",
        )
    noisy = np.flatnonzero(np.sqrt(_mean_square(fit, data)) > 3.0 * data.noise_um)
    for r in noisy.tolist():
        value, noise = float(np.sqrt(_mean_square(fit, data))[r]), float(data.noise_um[r])
        yield FINDINGS.finding(
            "modes-leave-structure",
            f"{responses[r]} keeps a residual of {value:.3g} µm RMS after averaging, while its noise is {noise:.3g} "
            "µm a sample: something else than these modes moves it (hall temperature, coolant, contact of the gauge).",
            Where(channel=responses[r]),
            evidence={"residual_um": value, "noise_um": noise},
        )


def _mean_square(fit: Fit, data: ModeData) -> Vector:
    squares = data.counts * fit.solution.left_out_um**2
    return np.asarray(squares.sum(axis=0) / data.counts.sum(axis=0))


def _number_of_modes(fit: Fit, data: ModeData, tried: Sequence[tuple[Fit, Vector]]) -> Iterator[Finding]:
    """Why one mode more is not supported."""
    more = [one for one in tried if one[0].spec.n_modes == fit.spec.n_modes + 1 and one[0].spec.film == fit.spec.film]
    same = [one for one in tried if one[0].spec.n_modes == fit.spec.n_modes and one[0].spec.film == fit.spec.film]
    n = fit.spec.n_modes
    plural = f"{n} modes" if n > 1 else "1 mode"
    if not more or not same:
        if len(tried) > 1:
            yield FINDINGS.finding(
                "modes-at-most", f"{plural}: as many as are tried.", evidence={"n_modes": n},
            )  # fmt: skip
        return
    # short runs leave some stretches without readings
    both = np.isfinite(more[0][1]) & np.isfinite(same[0][1])
    better = 1.0 - float(np.exp(np.log(more[0][1][both] / same[0][1][both]).mean())) if both.any() else 0.0
    tau = np.sort(more[0][0].tau_s)
    reasons = [
        "the runs are too short to leave stretches out"
        if not both.any()
        else f"the error on left-out stretches would {'fall' if better > 0 else 'rise'} by {abs(better):.1%}, "
        "which is within chance"
        if better < 0.05
        else f"the error on left-out stretches would fall by {better:.1%}, not in all of them"
    ]
    ratio = tau[1:] / tau[:-1]
    if len(ratio) and ratio.min() < NEAR:
        k = int(np.argmin(ratio))
        reasons.append(
            f"two of its time constants, {tau[k]:.0f} and {tau[k + 1]:.0f} s, are too close to be told apart"
        )
    if tau[-1] > data.longest_s:
        reasons.append(f"its slowest, {tau[-1]:.0f} s, is longer than the longest run, {data.longest_s:.0f} s")
    if tau[0] < 2.0 * data.period_s:
        reasons.append(f"its fastest, {tau[0]:.2g} s, is not resolved by samples {data.period_s:.3g} s apart")
    yield FINDINGS.finding(
        "no-further-mode",
        f"The tests support {plural}. {n + 1} are not supported: " + "; ".join(reasons) + ".",
        evidence={"n_modes": n, "improvement": round(better, 4), "tau_s_with_one_more": [float(t) for t in tau]},
    )


def loose_findings(tau_s: Vector, data: ModeData, low: Vector, high: Vector) -> Iterator[Finding]:
    """A warning for every time constant [s] without both bounds (n_modes,), NaN where there is none."""
    for tau, below, above in zip(np.sort(tau_s), low, high, strict=True):
        if np.isfinite(below) and np.isfinite(above):
            continue
        why = "longer than the runs" if tau > data.longest_s else "too little of it is seen beside the noise"
        yield FINDINGS.finding(
            "time-constant-unbounded",
            f"The time constant of {tau:.0f} s has no bound {'above' if np.isfinite(below) else 'below'}: {why}.",
            evidence={"tau_s": float(tau)},
        )


def _speeds(fit: Fit, data: ModeData) -> Iterator[Finding]:
    levels = data.levels_rpm
    if len(levels) == 1:
        yield FINDINGS.finding(
            "one-tested-speed",
            f"Only {levels[0]:.0f} r/min was tested. Between it and standing, heat is assumed to grow with "
            f"n^{float(fit.theta[fit.spec.n_modes]) if fit.spec.n_powers else fit.spec.level_exponent:.2g}.",
            evidence={"levels_rpm": [float(n) for n in levels]},
        )
    elif len(levels) == 2:
        yield FINDINGS.finding(
            "two-tested-speeds",
            f"Only {levels[0]:.0f} and {levels[1]:.0f} r/min were tested: speeds far from both are less certain.",
            evidence={"levels_rpm": [float(n) for n in levels]},
        )
