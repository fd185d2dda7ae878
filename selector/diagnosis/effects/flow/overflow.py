"""`flow.overflow`: a tank that spills at a level, and which tanks in a row a simulated level looks like.

Tank j empties by c_j·h_j^p (p = ½: Torricelli's outflow), the first is filled by the recorded inflow. The
simulation has no noise, so the constants and the levels at the start are found by least squares on its course.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy.optimize import least_squares as nonlinear_least_squares

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant, declared
from selector.diagnosis.shapes.residual import Remainder
from selector.diagnosis.shapes.signals import by_run, course, excited, lagged, no_flow, time_constants
from selector.types import Vector

#: Root mean square that may be left, and that needs no second look, over the spread of the course.
_FITS, _WELL = 0.05, 0.01


@dataclass(frozen=True, eq=False)
class Tanks:
    """One or two tanks whose last level is the simulated course."""

    inflow: Vector  #: (n_rows,): What fills the first tank, of size about 1
    #: (6,): Of filling, leak, emptying of the first and of the last tank, power of the outflow; how far the inflow
    #: runs along a line between samples (0: it is held, 1: it does)
    rates: Vector
    #: first and last: (n_runs,): Levels at the start of every run
    first: Vector
    last: Vector
    #: zero and size: Course = zero + size·level
    zero: float
    size: float
    n: int  #: Number of tanks

    def levels(
        self, comparison: Comparison, first_brim: float = np.inf, last_brim: float = np.inf, caught: float = 0.0
    ) -> tuple[Vector, Vector]:
        """Level of the first tank [its own unit] and the course of the last, with brims in these units.

        `caught` is the share of what the first tank spills that the second one gets.
        """
        brim = (last_brim - self.zero) / self.size
        h, y = np.zeros(len(comparison.time_s)), np.zeros(len(comparison.time_s))
        for k, (_, rows) in enumerate(comparison.rows_of_runs()):
            levels = self.first[k], self.last[k], self.n, first_brim, brim, caught
            h[rows], y[rows] = _filled(self.inflow[rows], comparison.time_s[rows], self.rates, *levels)
        return h, self.zero + self.size * y


def tanks_of(comparison: Comparison, simulated: Vector, inflow: Vector) -> Tanks | None:
    """One tank, or else two, that fill with the inflow like the simulated course does; None if neither does."""
    scale = float(np.std(inflow))
    size = float(np.ptp(simulated))
    if scale <= 0.0 or size <= 0.0:
        return None
    u = inflow / max(float(np.abs(inflow).max()), 1e-300)
    best: tuple[float, Tanks] | None = None
    for n, fills, torricelli in ((1, 15.0, True), (2, 8.0, True), (2, 30.0, True), (2, 8.0, False), (2, 30.0, False)):
        if best is None or best[0] > _WELL * float(np.std(simulated)):
            found = _fitted(comparison, simulated, u, n, size, fills, torricelli=torricelli)
            best = found if best is None or found[0] < 0.5 * best[0] else best
    return best[1] if best is not None and best[0] < _FITS * float(np.std(simulated)) else None


def _fitted(
    comparison: Comparison, simulated: Vector, u: Vector, n: int, size: float, fills: float, *, torricelli: bool
) -> tuple[float, Tanks]:
    """Fitted from a filling time of `fills` time constants per longest run on; (root mean square left, tanks).

    With `torricelli` the outflow goes with the root of the level, and nothing leaks or is read off zero.
    """
    n_runs = len(comparison.runs)
    low = float(simulated.min())
    rate = fills / comparison.longest_s
    begins = np.array([max((simulated[rows][0] - low) / size, 0.05) for _, rows in comparison.rows_of_runs()])
    guess = np.r_[np.log([rate, rate, rate]), 0.5, 0.0, 0.0 if torricelli else low / size, 0.5, begins, begins]
    if torricelli:
        guess[7:] += low / size
    free = np.ones(len(guess), dtype=bool)
    free[3:6] = not torricelli

    def made(x: Vector) -> Tanks:
        rates = np.array([np.exp(x[0]), x[4] * np.exp(x[0]), np.exp(x[1]), np.exp(x[2]), x[3], x[6]])
        first, last = np.abs(x[7 : 7 + n_runs]), np.abs(x[7 + n_runs :])
        return Tanks(u, rates, first, last, float(x[5] * size), size, n)

    def put(part: Vector) -> Vector:
        x = np.array(guess)
        x[free] = part
        return x

    def left(part: Vector) -> Vector:
        course = made(put(part)).levels(comparison)[1]
        return np.asarray(np.where(np.isfinite(course), course - simulated, size) / size)

    wide = np.full(2 * n_runs, 5.0)
    bounds = (
        np.r_[guess[:3] - 6.0, 0.1, -2.0, guess[5] - 3.0, 0.0, 0 * wide],
        np.r_[guess[:3] + 6.0, 1.3, 2.0, guess[5] + 3.0, 1.0, wide],
    )
    start = np.clip(guess, bounds[0] + 1e-9, bounds[1] - 1e-9)[free]
    limits = (bounds[0][free], bounds[1][free])
    found = nonlinear_least_squares(left, start, bounds=limits, x_scale="jac", max_nfev=40)
    return float(np.sqrt(np.mean(found.fun**2))) * size, made(put(found.x))


#: Of the first tank [its unit], of the last [unit of the course]; share of the first spill that the last gets.
Brims = tuple[float, float, float]


def refitted(
    comparison: Comparison, tanks: Tanks, recorded: Vector, brims: Brims | None
) -> tuple[float, Tanks, Brims | None]:
    """Filling, leak, emptying, zero and the brims, if there are some, fitted to a recorded course in the fitted rows.

    Levels at the start of the first runs are fitted too; of held-out runs they stay. Returns (root mean square left
    [unit of the course], tanks, brims).
    """
    rows = np.isfinite(recorded) & ~comparison.held_out
    free = [k for k, (_, part) in enumerate(comparison.rows_of_runs()) if not comparison.held_out[part][0]]
    moving = [k for k in (0, 1) if brims is not None and np.isfinite(brims[k])]
    whole, plain = tanks.levels(comparison)
    sizes = (max(float(np.ptp(whole)), 1e-9), float(np.ptp(plain)))

    def made(x: Vector) -> tuple[Tanks, Brims | None]:
        rates = tanks.rates * np.exp(np.r_[x[0], x[0], x[1], x[2], 0.0, 0.0])
        rates[1] += x[3] * rates[0]
        first, last = np.array(tanks.first), np.array(tanks.last)
        first[free] = np.abs(first[free] + x[5 : 5 + len(free)])
        last[free] = np.abs(last[free] + x[5 + len(free) : 5 + 2 * len(free)])
        other = np.setdiff1d(np.arange(len(first)), free)
        first[other] *= float(np.sum(first[free]) / max(float(np.sum(tanks.first[free])), 1e-12))
        last[other] = np.maximum(last[other] - x[4], 0.0)
        anew = Tanks(tanks.inflow, rates, first, last, tanks.zero + x[4] * tanks.size, tanks.size, tanks.n)
        if brims is None:
            return anew, None
        levels = list(brims)
        for k, change in zip(moving, x[5 + 2 * len(free) :], strict=False):
            levels[k] += change * sizes[k]
        if 0 in moving:
            levels[2] = float(np.clip(brims[2] + x[-1], 0.0, 1.0))
        return anew, (levels[0], levels[1], levels[2])

    def left(x: Vector) -> Vector:
        anew, levels = made(x)
        course = anew.levels(comparison, *levels)[1] if levels is not None else anew.levels(comparison)[1]
        return np.asarray((course - recorded)[rows] / tanks.size)

    n = 5 + 2 * len(free) + len(moving) + (0 in moving)
    found = nonlinear_least_squares(
        left, np.zeros(n), bounds=(-np.full(n, 1.5), np.full(n, 1.5)), max_nfev=40, diff_step=np.full(n, 1e-4)
    )
    return float(np.sqrt(np.mean(found.fun**2))) * tanks.size, *made(found.x)


@njit(cache=True, nogil=True)
def _filled(u, time_s, rates, first, last, n, first_brim, last_brim, caught):  # type: ignore[no-untyped-def]
    fill, leak, c1, c2, power, line = rates
    h, y = first, last
    levels, course = np.empty(len(u)), np.empty(len(u))
    for i in range(len(u)):
        if i > 0:
            step = (time_s[i] - time_s[i - 1]) / 2
            for j in range(2):
                inflow = fill * (u[i - 1] + line * (u[i] - u[i - 1]) * (j + 0.5) / 2) + leak
                between, spill = inflow, 0.0
                if n == 2:
                    between = c1 * max(h, 0.0) ** power
                    h = max(h + step * (inflow - between), 0.0)
                    if h > first_brim:
                        spill = (h - first_brim) / step
                        h = first_brim
                y = min(max(y + step * (between + caught * spill - c2 * max(y, 0.0) ** power), 0.0), last_brim)
        levels[i], course[i] = h, y
    return levels, course


_FALLING = ((-np.inf, 0.0),)
_RISING = ((0.0, np.inf),)
#: What spills is lost whole; half as much again where the brim lies between the levels that are tried.
_WHOLE = ((0.0, 1.5),)
_MOST = 30
#: With brims the refitted tanks have to err by less than this, over the error of those refitted without.
_BETTER = 0.8
_UPPER_SHARES = (0.6, 0.7, 0.8, 0.87, 0.94)  #: Quantiles of an upper tank's level at which it may spill.
_HIGH_SHARES = (0.975, 0.99, 0.997)  #: The same of a tank that is known well enough for a spill that is seldom.
_TUNED = 4.0  #: What a brim pays that was moved between the levels that are tried to where it explains most.


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    simulated = comparison.simulated_course(response)
    ceilings = _ceilings(comparison, response, simulated)
    unit = comparison.channel(response).unit
    # flows before voltages of pumps, then levels of other tanks
    names = comparison.with_role("flow") + comparison.with_role("voltage")
    names += comparison.with_role("displacement", "position", "size", "state")
    for name in [n for n in names if n != response and excited(course(comparison, n))][:3]:
        tanks = tanks_of(comparison, simulated, course(comparison, name))
        if tanks is not None:
            yield from _of_tanks(comparison, response, tanks, ceilings, name)
            return
    taus = time_constants(comparison, 12)
    taus = taus[taus <= 0.35 * comparison.longest_s][-6:]
    for ceiling in ceilings:
        for tau_s in (*taus[1::2], np.inf):
            lost = spilled(comparison, simulated, ceiling, float(tau_s))
            if np.any(lost):
                lag = {"tau_s": Quantity(float(tau_s), "s")} if np.isfinite(tau_s) else {}
                shape = {"ceiling": Quantity(ceiling, unit)} | lag
                yield Variant(lost[:, None], (f"spills at {ceiling:.3g} {unit}",), shape, bounds=_RISING)
    for name, level, lost in _uppers(comparison, response, taus):
        shape = {"upper_ceiling": Quantity(level, "1")}
        names = (f"inflow lost as {name} spills above",)
        yield Variant(lost[:, None], names, shape, bounds=_FALLING, sources=_recorded(comparison, name))


def _of_tanks(
    comparison: Comparison, response: str, tanks: Tanks, ceilings: list[float], inflow: str
) -> Iterator[Variant]:
    """The same tanks with brims: on a grid, and where they explain most."""
    remainder, unit = Remainder(comparison, response), comparison.channel(response).unit
    whole, plain = tanks.levels(comparison)
    fitted = ~comparison.held_out
    shares = (*_UPPER_SHARES, *_HIGH_SHARES)
    uppers = [np.inf, *np.quantile(whole[fitted], shares)] if tanks.n == 2 else [np.inf]
    tried: list[tuple[float, Brims]] = []

    def lost(brims: Brims) -> Vector:
        return tanks.levels(comparison, *brims)[1] - plain

    for upper in uppers:
        for lower in (*ceilings, np.inf):
            for caught in (0.0, 0.5) if np.isfinite(upper) else (0.0,):
                if np.isfinite(upper) or np.isfinite(lower):
                    brims = (float(upper), float(lower), caught)
                    tried.append((remainder.share(lost(brims), most=1.0), brims))
    tried = sorted(tried, key=lambda pair: -pair[0])[:_MOST]
    best: dict[tuple[bool, bool], Brims] = {}
    for _, brims in reversed(tried):
        best[bool(np.isfinite(brims[0])), bool(np.isfinite(brims[1]))] = brims
    for _, brims in tried:
        column = lost(brims)
        if np.any(column):
            yield _with_brims(comparison, unit, column, brims, whole, inflow)
    recorded = comparison.recorded[response]
    without, _, _ = refitted(comparison, tanks, recorded, None)
    for brims in best.values():
        error, anew, moved = refitted(comparison, tanks, recorded, brims)
        if moved is not None and error < _BETTER * without:
            whole, course_ = anew.levels(comparison)[0], anew.levels(comparison, *moved)[1]
            tuned = _with_brims(comparison, unit, course_ - plain, moved, whole, inflow)
            yield replace(tuned, looked_at=_TUNED)


def _with_brims(comparison: Comparison, unit: str, column: Vector, brims: Brims, whole: Vector, inflow: str) -> Variant:
    shape, words = {}, []
    if np.isfinite(brims[1]):
        shape["ceiling"] = Quantity(float(brims[1]), unit)
        words.append(f"spills at {brims[1]:.3g} {unit}")
    if np.isfinite(brims[0]):
        share = float(brims[0]) / float(whole.max())
        shape["upper_ceiling"] = Quantity(share, "1")
        shape["caught"] = Quantity(float(brims[2]), "1")
        words.append(f"the store above spills at {100 * share:.3g} % of its highest level")
    sources = _recorded(comparison, inflow)
    return Variant(column[:, None], (", ".join(words),), shape, sources=sources, bounds=_WHOLE)


def spilled(comparison: Comparison, level: Vector, ceiling: float, tau_s: float) -> Vector:
    """What a simulated level loses by spilling at a ceiling [its unit], ≤ 0: at once there, forgotten with `tau_s`."""
    return by_run(comparison, lambda y, t: _reflected(y, t, ceiling, tau_s), level, comparison.time_s)


@njit(cache=True, nogil=True)
def _reflected(level, time_s, ceiling, tau_s):  # type: ignore[no-untyped-def]
    lost = np.zeros(len(level))
    d = 0.0
    for k in range(len(level)):
        if k > 0:
            d *= np.exp(-(time_s[k] - time_s[k - 1]) / tau_s)
        d = min(d, ceiling - level[k])
        lost[k] = d
    return lost


def _ceilings(comparison: Comparison, response: str, simulated: Vector) -> list[float]:
    """Levels that the recording hardly exceeds and the simulation does; the recording's own levels at its top."""
    recorded = comparison.recorded[response]
    fitted = np.isfinite(recorded) & ~comparison.held_out
    if not fitted.any():
        return []
    seen = recorded[fitted]
    tops = np.unique(np.quantile(seen, (0.85, 0.9, 0.94, 0.97, 0.985, 0.995, 0.9985)))
    return [float(top) for top in tops if float(np.mean(simulated[fitted] > top)) > 0.002]


def _uppers(comparison: Comparison, response: str, taus: Vector) -> Iterator[tuple[str, float, Vector]]:
    """(channel, level, course) of what the response loses because a tank above it spills.

    The level above is recorded, simulated alone, or the inflow lagged; what is lost reaches the response late.
    """
    levels: list[tuple[str, Vector]] = []
    names = comparison.with_role("flow", "voltage", "displacement", "position", "size")
    for name in (*names, *(name for name in comparison.simulated if name not in comparison.recorded)):
        values = course(comparison, name)
        if not excited(values):
            continue
        if name in comparison.recorded:
            levels += [(name, lagged(comparison, values, float(tau), settled=True)) for tau in taus[1::2]]
        else:
            levels.append((name, values))
    for name, level in levels:
        for share in _UPPER_SHARES:
            ceiling = float(np.quantile(level[~comparison.held_out], share))
            excess = np.maximum(level - ceiling, 0.0)
            for tau in taus[2::2]:
                lost = lagged(comparison, excess, float(tau))
                if np.any(lost):
                    yield name, ceiling, lost


def _recorded(comparison: Comparison, name: str) -> tuple[str, ...]:
    return (name,) if name in comparison.recorded else ()


def _testable(comparison: Comparison, response: str) -> str | None:
    reason = no_flow(comparison, response)
    if reason is None and not excited(comparison.simulated_course(response)):
        return f"the simulated {response} does not move"
    return reason


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    shape = fitted.variant.shape
    parameters, parts = fitted.size, []
    if "ceiling" in shape:
        parameters["ceiling"] = replace(fitted.parameter("ceiling"), unit=fitted.unit)
        parts.append(f"spills at {shape['ceiling'].value:.3g} {fitted.unit}")
    if "caught" in shape:
        parameters |= {"upper_ceiling": shape["upper_ceiling"], "caught": shape["caught"]}
    if "upper_ceiling" in shape:
        parts.append("loses inflow while the store above it spills")
    text = f"{fitted.response} {' and '.join(parts)}; this takes up to {fitted.up_to}"
    return Reading(text, parameters)


EFFECTS = (declared("flow.overflow", _variants, _testable, _reading),)
