"""How many thermal modes the tests support, and which law of the speed predicts what they do not show.

Beside it what a user should know about the fitted modes, as findings.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.special import chdtri
from threadpoolctl import threadpool_limits

from selector.findings import Finding, Where
from selector.physics.thermal.finding_table import FINDINGS
from selector.physics.thermal.modes.fit import (
    USUAL_EXPONENT,
    Fit,
    Law,
    ModeSpec,
    block_weights,
    grown,
    searched,
    with_film,
)
from selector.physics.thermal.modes.heldout import (
    LeftOutTests,
    held_out_um,
    law_errors,
    left_out_tests,
    resemblance,
    speed_folds,
    tau_intervals,
    time_folds,
)
from selector.physics.thermal.modes.modes import ModalModel
from selector.physics.thermal.modes.thermal_test import ModeData, ThermalTest, mode_data
from selector.types import Vector

NEAR = 1.7  #: Neighbouring time constants below this ratio look like one in most records.


def choice_findings(
    tests: Sequence[ThermalTest],
    data: ModeData,
    fit: Fit,
    tried: Sequence[tuple[Fit, Vector]],
    tau_low_s: Vector,
    tau_high_s: Vector,
    responses: Sequence[str],
) -> Iterator[Finding]:
    """Findings on the number of modes, their certainty, speeds, film and starts."""
    yield from _number_of_modes(fit, data, tried)
    yield from loose_findings(fit.tau_s, data, tau_low_s, tau_high_s)
    yield from _speeds(data)
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
        yield start_finding(
            tests[run].run,
            "only a start of its own explains it" if turning else "the spindle never turns in it",
            turning=turning,
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


def start_finding(run: str, why: str, *, turning: bool = True) -> Finding:
    """That a run does not begin at rest and cold, and by what this is seen; whether the spindle turns in it."""
    return FINDINGS.finding(
        "start-not-at-rest",
        f"Run {run} does not begin at rest and cold: {why}. The state at its start was fitted too, so it says less "
        "about the steady levels.",
        Where(run=run),
        suggestion="let the machine rest until it is cold before a heating test" if turning else "",
        level="warning" if turning else "info",
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
        else f"the error on left-out stretches would {'fall' if better > 0 else 'rise'} by {100 * abs(better):.1f} %, "
        "which is within chance"
        if better < 0.05
        else f"the error on left-out stretches would fall by {100 * better:.1f} %, not in all of them"
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


def _speeds(data: ModeData) -> Iterator[Finding]:
    """That two speeds were tested; what one speed leaves open depends on the duty cycle (`speed_findings`)."""
    levels = data.levels_rpm
    if len(levels) == 2:
        yield FINDINGS.finding(
            "two-tested-speeds",
            f"Only {levels[0]:.0f} and {levels[1]:.0f} r/min were tested: speeds far from both are less certain.",
            evidence={"levels_rpm": [float(n) for n in levels]},
        )


def with_law(fit: Fit, data: ModeData, law_kind: Law) -> Fit:
    """The fit with another law, searched from its time constants and film."""
    modes, old = fit.spec.n_modes, fit.spec
    exponent = float(fit.theta[modes]) if old.n_powers else USUAL_EXPONENT[0]
    spec = replace(old, law_kind=law_kind, level_exponent=exponent if law_kind == "levels" else old.level_exponent)
    powers = np.full(spec.n_powers, exponent)
    start = np.r_[fit.theta[:modes], powers, fit.theta[modes + old.n_powers :]]
    return searched(spec, data, start, fit.weights)


def law_candidates(fit: Fit, data: ModeData) -> Iterator[tuple[Fit, Vector]]:
    """Fits with every law that the tests can tell apart, simplest first, with their errors at left-out speeds.

    With tests at two levels, or none that can be left out, the errors are those of left-out stretches of time.
    """
    folds = speed_folds(data)
    several = len(data.levels_rpm) > 2
    turning = fit.spec.law_kind in ("turning", "turning-powers")
    kinds: list[Law] = ["power"]
    if len(data.levels_rpm) > 1:
        kinds.append("powers")
    if several and turning:
        kinds += ["turning", "turning-powers"]
    if several and not turning and fit.spec.film == "none" and fit.spec.n_modes > 1:
        kinds.append("mode-powers")
    if several:
        kinds.append("levels")
    for kind in kinds:
        one = fit if kind == fit.spec.law_kind else with_law(fit, data, kind)
        errors = law_errors(one, data, folds) if folds else held_out_um(one, data, time_folds(data), own_zeros=False)
        yield one, errors


MOST_MODES = 7
MOST_WITH_FILM = 5
NO_WORSE = 0.01  #: Mean squared errors that differ by less than this share are the same.
#: Heat that does not depend on the speed while the spindle turns is believed where it lowers the logarithm of the error
#: at left-out speeds by this much: below the slowest tested speed it makes a large difference that no test shows.
TURNING = 0.1
CERTAIN = 0.999  #: Probability with which chance must not explain what a mode adds.
FAR_AHEAD = 0.3  #: A film this much better in the logarithm of the error is not the law of the speed in disguise.
#: Time constants longer than the runs are accepted where they improve the logarithm of the error by this much.
WORTH_A_GUESS = 0.2
#: A run whose residuals are this much larger than the others', and become this much smaller with a start of its own,
#: did not begin at rest and cold.
WARM_START = 3.0
WARM_GAIN = 0.1  #: Starts of their own are believed where they lower the logarithm of the held-out error by this much.


@dataclass(frozen=True)
class ModalFit:
    """Thermal modes with what is known of their certainty."""

    model: ModalModel  #: What was found
    #: tau_low_s and tau_high_s: (n_modes,): 95 % confidence intervals of the time constants [s]; NaN where the tests
    #: set no bound
    tau_low_s: Vector
    tau_high_s: Vector
    #: (n_responses,): Root mean square of the block residuals [µm], each block counting as its samples
    residual_um: Vector
    #: (n_responses,): The same on what was left out: tests from cold where others remain, else stretches of time
    heldout_um: Vector | None
    left_out: LeftOutTests | None  #: Whole tests that were left out; None: there are none that others can predict
    warm: tuple[str, ...]  #: Runs that do not begin at rest and cold
    findings: tuple[Finding, ...]  #: What a user should know


def choose_modes(tests: Sequence[ThermalTest], responses: Sequence[str]) -> ModalFit:
    """The simplest modes whose error on what was left out is within noise of the best.

    Tried are 1 to 7 modes with constant time constants, and 1 to 5 with a film that grows with the speed, by their
    error on stretches of time that are left out; then the laws of the speed, by their error on left-out speeds.
    The zero of every run is free. Runs begin at rest and cold, but for those in which the spindle never turns, and
    those that nothing else explains (a finding says so). The hall is taken to be constant: `driven_model` is for
    recordings in which it is not.

    Raises InputError if the tests cannot be used: none, none that turns, too few samples.
    """
    with threadpool_limits(1, "blas"):  # thousands of small matrices: threads would only wait for each other
        return _chosen(tests, responses)


def _chosen(tests: Sequence[ThermalTest], responses: Sequence[str]) -> ModalFit:
    data = mode_data(tests)
    plain = _plain_fits(data)
    spec = ModeSpec(1, _sweep_law(data, plain), free_starts=_idle_runs(data))
    tried, best = _swept(spec, data, plain)
    # a start that is not at rest hides behind slow modes and films: it is looked for before these are there too
    warm = {*_warm_runs(plain(replace(spec, n_modes=3)), data), *_warm_runs(best, data)}
    if warm:
        freed = replace(spec, free_starts=tuple(sorted({*spec.free_starts, *warm})))
        freed_tried, freed_best = _swept(freed, data, plain)
        if float(np.log(_scores(freed_best, data) / _scores(best, data)).mean()) < -WARM_GAIN:
            spec, tried, best = freed, freed_tried, freed_best
    final = searched(best.spec, data, best.theta, block_weights(data, best))
    laws = list(law_candidates(final, data))
    final = laws[_simplest([errors for _, errors in laws])][0]
    return _finished(tests, responses, data, final, tried)


def _plain_fits(data: ModeData) -> Callable[[ModeSpec], Fit]:
    """Fits without a film, each grown from that of one mode less; several steps look at the same ones."""
    weights = block_weights(data)

    @cache
    def plain(spec: ModeSpec) -> Fit:
        smaller = plain(replace(spec, n_modes=spec.n_modes - 1)) if spec.n_modes > 1 else None
        return grown(smaller, spec, data, weights)

    return plain


def _sweep_law(data: ModeData, plain: Callable[[ModeSpec], Fit]) -> Law:
    """Two powers, or with them what runs while the spindle turns, where they describe the levels as free gains do.

    Laws are compared by their error at left-out speeds, each without or with a film, whichever is better: a film that
    is missing would be taken for the law.
    """
    if len(data.levels_rpm) < 2:
        return "power"
    fit = plain(ModeSpec(3, "powers", free_starts=_idle_runs(data)))
    free = with_law(fit, data, "levels")
    folds = speed_folds(data)
    if not folds:
        return "powers" if fit.cost < 1.1 * free.cost else "levels"
    kinds: tuple[Law, ...] = ("powers", "turning", "turning-powers") if len(data.levels_rpm) > 2 else ("powers",)
    filmed = with_film(fit, data)
    errors, costs = {}, {}
    for kind in kinds:
        both = [with_law(one, data, kind) for one in (fit, filmed)]
        errors[kind] = min(float(np.log(law_errors(one, data, folds)).mean()) for one in both)
        costs[kind] = min(one.cost for one in both)
    law = min(kinds, key=lambda one: errors[one] - (TURNING if one == "powers" else 0.0))
    better = float(np.log(law_errors(free, data, folds)).mean()) < errors[law] - 0.1
    return "levels" if better or costs[law] > 3.0 * free.cost else law


def _swept(spec: ModeSpec, data: ModeData, plain_of: Callable[[ModeSpec], Fit]) -> tuple[list[tuple[Fit, Vector]], Fit]:
    """All numbers of modes without and with a film, each with its held-out errors; and the simplest good one."""
    tried: list[tuple[Fit, Vector]] = []
    film: Fit | None = None
    for k in range(1, MOST_MODES + 1):
        plain = plain_of(replace(spec, n_modes=k))
        tried.append((plain, _scores(plain, data)))
        # before a film is believed in, gains that follow no simple law must have had their chance
        for other in _OTHER_LAWS if _laws_open(tried, data, spec) else ():
            one = with_law(plain, data, other)
            tried.append((one, _scores(one, data)))
        if k <= MOST_WITH_FILM and _worth_a_film(tried, k):
            film = with_film(plain, data, film)
            tried.append((film, _scores(film, data)))
        elif _no_gain([scores for fit, scores in tried if fit.spec == replace(spec, n_modes=fit.spec.n_modes)]):
            break
    tried.sort(key=_complexity)
    best = tried[_simplest([scores for _, scores in tried])]
    # a mode slower than the longest run is a straight line there, and anything beyond it
    seen = [one for one in tried if float(one[0].tau_s.max()) <= data.longest_s]
    if seen:
        bounded = seen[_simplest([scores for _, scores in seen])]
        if float(np.log(bounded[1] / best[1]).mean()) < WORTH_A_GUESS:
            best = bounded
    return tried, _without_chance(best[0], tried, data)


def _without_chance(fit: Fit, tried: list[tuple[Fit, Vector]], data: ModeData) -> Fit:
    """The fit less its last modes, as long as chance alone lowers the sum of squares as much as the last one did."""
    for simpler, _ in sorted(tried, key=lambda one: -one[0].spec.n_modes):
        spec = simpler.spec
        if (spec.n_modes, spec.film, spec.law_kind) == (fit.spec.n_modes - 1, fit.spec.film, fit.spec.law_kind):
            added = fit.spec.n_searched - spec.n_searched
            added += fit.solution.coefficients.size - simpler.solution.coefficients.size
            variance = fit.cost / max(int((fit.weights > 0).sum()), 1) * resemblance(fit, data)
            if simpler.cost - fit.cost > variance * float(chdtri(added, 1.0 - CERTAIN)):
                break
            fit = simpler
    return fit


_OTHER_LAWS: tuple[Law, ...] = ("mode-powers", "levels")


def _complexity(candidate: tuple[Fit, Vector]) -> tuple[bool, int, bool]:
    spec = candidate[0].spec
    return spec.film == "growing", spec.n_modes, spec.law_kind in _OTHER_LAWS


def _laws_open(tried: list[tuple[Fit, Vector]], data: ModeData, spec: ModeSpec) -> bool:
    """Whether other laws can be told apart, and a film is not far ahead of all of them."""
    films = [float(np.log(scores).mean()) for fit, scores in tried if fit.spec.film == "growing"]
    plains = [float(np.log(scores).mean()) for fit, scores in tried if fit.spec.film == "none"]
    ahead = bool(films) and min(films) < min(plains) - FAR_AHEAD
    return len(data.levels_rpm) > 2 and spec.law_kind == "powers" and len(films) < MOST_WITH_FILM and not ahead


def _no_gain(scores: Sequence[Vector]) -> bool:
    """Whether the last two modes did not lower the error."""
    means = [float(np.log(one).mean()) for one in scores]
    return len(means) > 2 and min(means[-2:]) > min(means[:-2]) - 0.5 * NO_WORSE


def _worth_a_film(tried: list[tuple[Fit, Vector]], k: int) -> bool:
    """Up to two modes always; beyond, if it was better for one mode less."""
    if k <= 2:
        return True
    before = [(fit.spec, float(np.log(scores).mean())) for fit, scores in tried if fit.spec.n_modes == k - 1]
    films = [error for spec, error in before if spec.film == "growing"]
    plains = [error for spec, error in before if spec.film == "none"]
    return bool(films) and min(films) < min(plains) - NO_WORSE


def _scores(fit: Fit, data: ModeData) -> Vector:
    return 1e-9 + held_out_um(fit, data, time_folds(data), own_zeros=False)


def _simplest(errors: Sequence[Vector]) -> int:
    """First candidate whose squared errors are within noise of the best; they are in order of simplicity."""
    logs = [2.0 * np.log(np.maximum(one, 1e-12)) for one in errors]
    best = int(np.argmin([one.mean() for one in logs]))
    for i, one in enumerate(logs):
        # the median over responses would hide the one that needs the mode; the mean does not
        difference = (one - logs[best]).mean(axis=1)
        spread = float(difference.std(ddof=1) / np.sqrt(len(difference))) if len(difference) > 1 else 0.0
        if float(difference.mean()) <= max(NO_WORSE, min(2.0 * spread, 10 * NO_WORSE)):
            return i
    return best


def _idle_runs(data: ModeData) -> tuple[int, ...]:
    """Runs in which the spindle never turns: whatever they show began before them."""
    return tuple(
        run
        for run, (begin, end) in enumerate(data.bounds)
        if (data.speed_rpm[begin:end] < 0.01 * data.fastest_rpm).all()
    )


def _warm_runs(fit: Fit, data: ModeData) -> tuple[int, ...]:
    """Runs that only a start of their own explains."""
    runs = range(len(data.bounds))

    def misfits(one: Fit) -> Vector:
        return np.array([float((one.solution.residual[b:e] ** 2).mean()) for b, e in data.bounds])

    before = misfits(fit)
    out = []
    for run in runs:
        others = [before[other] for other in runs if other != run]
        if run in fit.spec.free_starts or not others or before[run] < WARM_START * max(float(np.median(others)), 1.0):
            continue
        spec = replace(fit.spec, free_starts=tuple(sorted((*fit.spec.free_starts, run))))
        if before[run] > WARM_START * misfits(searched(spec, data, fit.theta, fit.weights))[run]:
            out.append(run)
    return tuple(out)


def hall_drives(data: ModeData) -> bool:
    """Whether the hall temperatures, as further inputs, lower the error on left-out stretches."""
    with threadpool_limits(1, "blas"):
        plain = _plain_fits(data)
        fit = plain(ModeSpec(3, _sweep_law(data, plain), free_starts=_idle_runs(data)))
        driven = searched(replace(fit.spec, with_hall=True), data, fit.theta, fit.weights)
        difference = 2.0 * np.log(_scores(driven, data) / _scores(fit, data)).mean(axis=1)
    return float(difference.mean()) < -max(NO_WORSE, 2.0 * float(difference.std(ddof=1)) / np.sqrt(len(difference)))


def _finished(
    tests: Sequence[ThermalTest], responses: Sequence[str], data: ModeData, fit: Fit, tried: list[tuple[Fit, Vector]]
) -> ModalFit:
    order = np.argsort(fit.tau_s)
    low, high = (bound[order] for bound in tau_intervals(fit, data))
    left_out = left_out_tests(fit, data)
    heldout = np.sqrt(np.mean(_scores(fit, data) ** 2, axis=0)) if left_out is None else left_out.rmse_um
    return ModalFit(
        model=fit.model(data, responses),
        tau_low_s=low,
        tau_high_s=high,
        residual_um=np.sqrt(_mean_square(fit, data)),
        heldout_um=heldout,
        left_out=left_out,
        warm=tuple(tests[run].run for run in fit.spec.free_starts),
        findings=tuple(choice_findings(tests, data, fit, tried, low, high, responses)),
    )
