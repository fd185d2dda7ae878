"""Whether what the patent prints follows from its own numbers and from one recording: grouping, models, effects."""

import math
from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from selector.audit.printed import (
    CLOSURE,
    CUT_ROWS,
    ENTRY_HALF_UNIT,
    GROUPS_CLAIMED,
    LEVEL,
    PAIRS,
    REPRESENTATIVES,
    SENSORS,
    SIMILARITY,
    Y_THREE_SENSORS,
    Y_TWO_SENSORS,
    Z_THREE_SENSORS,
    Z_TWO_SENSORS,
    AuditLine,
    PrintedModel,
    PrintedPair,
    judged,
)
from selector.sensors.groups import LambdaStep, lambda_axis, lambda_cut, transitive_closure
from selector.types import Vector

_PAIR = "R² and adjusted R²"
_of_pair, _of_models = partial(judged, _PAIR), partial(judged, "models")


def r2_lines(rises: Mapping[str, Vector], responses: Mapping[str, Vector]) -> list[AuditLine]:
    """Printed pairs of R² on the reconstruction; contradictions (b) and (d). Rises [K], responses [µm]."""
    lines = []
    for pair in PAIRS:
        sensors = " & ".join("Δ" + name for name in pair.sensors)
        found = {name: r2_pair([rises[s] for s in pair.sensors], values) for name, values in responses.items()}
        for position, (label, printed) in enumerate((("R²", pair.r2), ("adjusted R²", pair.adjusted_r2))):
            values = {name: both[position] for name, both in found.items()}
            lines.append(
                _of_pair(
                    f"{label} of {sensors}",
                    f"{printed:.4f}",
                    ", ".join(f"{value:.4f} ({name})" for name, value in values.items()),
                    all(abs(value - printed) <= ENTRY_HALF_UNIT for value in values.values()),
                    "linear regression on the reconstruction, built to have it for both displacements because the "
                    "patent does not say for which one its table is",
                    yes="agrees by construction",
                )
            )
    two, three = PAIRS
    smallest = [fewest_samples(pair, len(pair.sensors)) for pair in PAIRS]
    with_products = [fewest_samples(three, len(m.terms) - 1) for m in (Z_THREE_SENSORS, Y_THREE_SENSORS)]
    return [
        *lines,
        _of_pair(
            "(b) what adding ΔT5 does to adjusted R²",
            f'it "falls" to {three.adjusted_r2}',
            f"it rises from {two.adjusted_r2} to {three.adjusted_r2}",
            three.adjusted_r2 < two.adjusted_r2,
            "the printed numbers themselves; by adjusted R² the three sensors win, and taking two is parsimony",
        ),
        AuditLine(
            _PAIR,
            "(d) number of observations m",
            "not printed",
            f"m ≥ {max(smallest)}",
            "cannot be checked",
            f"1 − R'² = (m−1)/(m−p−1)·(1 − R²) with four decimals needs m ≥ {smallest[0]} for the pair of two sensors "
            f"and m ≥ {smallest[1]} for that of three; there is no upper limit. If the second pair belonged to the "
            f"models with products, m ≥ {with_products[0]} (Z, 4 terms) and {with_products[1]} (Y, 6 terms). The "
            f"reconstruction has {len(next(iter(responses.values())))}",
        ),
        _m_is_observations(two),
    ]


def model_lines(rises: Mapping[str, Vector], z: Vector, y: Vector, z_second: Vector) -> list[AuditLine]:
    """Every printed coefficient against a regression on the reconstruction, and the four models against each other.

    Raises KeyError: `rises` lacks T1, T3 or T5.
    """
    key = (rises["T1"], rises["T3"], rises["T5"])
    lines = []
    for model, values, column in (
        (Z_TWO_SENSORS, z, "Z"),
        (Y_TWO_SENSORS, y, "Y"),
        (Z_THREE_SENSORS, z_second, "Z_embodiment2"),
        (Y_THREE_SENSORS, y, "Y"),
    ):
        found = _coefficients(model.columns(*key), values)
        for term, text, ours in zip(model.terms, model.printed, found, strict=True):
            decimals = len(text.split(".")[1])
            lines.append(
                _of_models(
                    f"{model.name}: {'·'.join(f'Δ{name}' for name in term) or 'constant'}",
                    text.replace("-", "−"),
                    f"{ours:.{decimals}f}".replace("-", "−"),
                    abs(float(text) - ours) <= 0.5 * 10.0**-decimals,
                    f"least squares on the reconstruction, response {column}, which was solved for to have it",
                    yes="agrees by construction",
                )
            )
    joint = _coefficients(Z_THREE_SENSORS.columns(*key), z)
    gap = (Z_THREE_SENSORS.columns(*key) @ Z_THREE_SENSORS.coefficients) - (
        Z_TWO_SENSORS.columns(*key) @ Z_TWO_SENSORS.coefficients
    )
    return [
        *lines,
        _of_models(
            "both models of Z from the recording that gives both models of Y",
            ", ".join(text.replace("-", "−") for text in Z_THREE_SENSORS.printed),
            ", ".join(f"{value:.4f}".replace("-", "−") for value in joint),
            bool(np.abs(joint - Z_THREE_SENSORS.coefficients).max() <= ENTRY_HALF_UNIT),
            "three-sensor fit to the same Z as the two-sensor model. A recording that starts at rest was found for R, "
            "the pairs, both two-sensor models and either three-sensor model, but none for all four models; on this "
            f"one the two models of Z differ by {gap.std():.1f} µm (standard deviation). The patent records anew for "
            "its second embodiment, so the four need not share a recording; ours has a second Z for it",
            no="in tension",
        ),
        _at_rest(),
    ]


def fewest_samples(pair: PrintedPair, n_terms: int) -> int:
    """Smallest m for which some R² and its adjusted R² round to the printed pair, P eq. 2."""
    low, high = 1 - pair.r2 - ENTRY_HALF_UNIT, 1 - pair.r2 + ENTRY_HALF_UNIT
    low_adjusted, high_adjusted = 1 - pair.adjusted_r2 - ENTRY_HALF_UNIT, 1 - pair.adjusted_r2 + ENTRY_HALF_UNIT
    m = n_terms + 2
    while True:
        factor = (m - 1) / (m - n_terms - 1)
        if factor * low < high_adjusted and factor * high > low_adjusted:
            return m
        m += 1


def r2_pair(regressors: list[Vector], response: Vector) -> tuple[float, float]:
    """(R², adjusted R²) of a linear regression with intercept, P eq. 2."""
    columns = np.column_stack([np.ones(len(response)), *regressors])
    residual = response - columns @ _coefficients(columns, response)
    share = float(residual @ residual / ((response - response.mean()) ** 2).sum())
    m, p = len(response), len(regressors)
    return 1 - share, 1 - (m - 1) / (m - p - 1) * share


def _coefficients(columns: NDArray[np.float64], response: Vector) -> Vector:
    scale = np.linalg.norm(columns, axis=0)
    return np.asarray(np.linalg.lstsq(columns / scale, response, rcond=None)[0] / scale, dtype=np.float64)


def _m_is_observations(pair: PrintedPair) -> AuditLine:
    p = len(pair.sensors)
    with_sensors = 1 - (8 - 1) / (8 - p - 1) * (1 - pair.r2)
    return _of_pair(
        "(c) m is the number of temperature variables",
        f"m variables x_j, j = 1…m; adjusted R² {pair.adjusted_r2}",
        f"{with_sensors:.4f} with m = 8",
        math.isclose(with_sensors, pair.adjusted_r2, abs_tol=ENTRY_HALF_UNIT),
        "the text uses m for the candidate variables (2^m − 1 combinations) and in eq. 2 for the number of "
        "observations; only the latter gives the printed values",
    )


def _at_rest() -> AuditLine:
    constants = ", ".join(
        f"{m.name} {m.printed[0].replace('-', '−')} µm"
        for m in (Z_TWO_SENSORS, Y_TWO_SENSORS, Z_THREE_SENSORS, Y_THREE_SENSORS)
    )
    return _of_models(
        "displacement at rest, all rises 0",
        "0 (gauges are set to zero at the start)",
        constants,
        False,
        "the constants are the models' own error in the first sample: they are fitted, not physics",
        no="in tension",
    )


def similarity_lines(rises: NDArray[np.float64]) -> list[AuditLine]:
    """R against the correlations of the reconstructed recording, `rises` of shape (n_samples, 8) [K]; P eq. 1."""
    found = np.asarray(np.corrcoef(rises, rowvar=False), dtype=np.float64)
    told = partial(judged, "similarity matrix R")
    lines = [
        told(
            f"r({a + 1},{b + 1}) and r({b + 1},{a + 1})",
            _twice(SIMILARITY, a, b),
            f"{found[a, b]:.4f}",
            _same(SIMILARITY[a, b], found[a, b]) and _same(SIMILARITY[b, a], found[a, b]),
            "correlation of the reconstructed recording, which was solved for to have it",
            yes="agrees by construction",
        )
        for a, b in _pairs()
    ]
    smallest = float(np.linalg.eigvalsh(SIMILARITY)[0])
    return [
        *lines,
        told("diagonal", "1.0000 eight times", "1", bool((np.diag(SIMILARITY) == 1).all()), "r(i,i) = 1"),
        told(
            "symmetry",
            "28 pairs, each printed twice",
            f"{int((SIMILARITY != SIMILARITY.T).sum() // 2)} pairs differ",
            bool((SIMILARITY == SIMILARITY.T).all()),
            "a correlation matrix is symmetric",
        ),
        told(
            "R is a correlation matrix",
            "implied",
            f"smallest eigenvalue {smallest:.1e}",
            smallest > 0,
            "positive definite, so there are recordings with exactly this matrix, and the reconstruction is one of "
            "them; the raw table of the patent was a picture and is lost",
        ),
    ]


def closure_lines() -> list[AuditLine]:
    """t(R) and its cut at 0.995, P steps 2 and 3."""
    closure = transitive_closure(SIMILARITY)
    lines = [
        judged(
            "closure t(R)",
            f"t({a + 1},{b + 1}) and t({b + 1},{a + 1})",
            _twice(CLOSURE, a, b),
            f"{closure[a, b]:.4f}",
            # max and min copy entries, so nothing but equality will do
            bool(CLOSURE[a, b] == closure[a, b] == CLOSURE[b, a]),
            "max–min transitive closure of the printed R",
        )
        for a, b in _pairs()
    ]
    lines.append(
        judged(
            "closure t(R)",
            "diagonal",
            "1.0000 eight times",
            "1",
            bool((np.diag(CLOSURE) == np.diag(closure)).all()),
            "the closure of a reflexive relation is reflexive",
        )
    )
    cut = ["".join("1" if entry >= LEVEL else "0" for entry in row) for row in closure]
    lines += [
        judged("cut at λ = 0.995", f"row {i + 1}", row, cut[i], row == cut[i], "t(i,j) ≥ 0.995")
        for i, row in enumerate(CUT_ROWS)
    ]
    return lines


def group_lines() -> list[AuditLine]:
    """The groups, and every other level at which they could have been cut; contradiction (a)."""
    told = partial(judged, "groups")
    partition = lambda_cut(SIMILARITY, LEVEL, SENSORS)
    steps = list(lambda_axis(SIMILARITY, SENSORS))
    here = next(step for step in steps if step.low < LEVEL <= step.high)
    threes = [step for step in steps if len(step.partition.groups) == GROUPS_CLAIMED]
    apart = [step for step in steps if _keeps_apart(step)]
    coarsest = apart[-1]
    return [
        told(
            "(a) number of groups at λ = 0.995",
            f"{GROUPS_CLAIMED} groups",
            f"{len(partition.groups)} groups: {_listed(partition.groups)}",
            len(partition.groups) == GROUPS_CLAIMED,
            "counted in the printed cut itself: its rows have only "
            f"{len(set(CUT_ROWS))} different patterns. Every λ in ({here.low:.4f}, {here.high:.4f}] cuts the same",
        ),
        told(
            "(a) three groups with 1, 3 and 5 apart, at any λ",
            "one representative from each of 3 groups",
            "; ".join(f"({s.low:.4f}, {s.high:.4f}]: {_listed(s.partition.groups)}" for s in threes) or "no such λ",
            any(_keeps_apart(step) for step in threes),
            "the only levels with three groups keep 3 and 5 together",
        ),
        told(
            "(a) λ at which 1, 3 and 5 are apart",
            f"{LEVEL}",
            f"λ > {coarsest.low:.4f}; first in ({coarsest.low:.4f}, {coarsest.high:.4f}] with "
            f"{len(coarsest.partition.groups)} groups {_listed(coarsest.partition.groups)}",
            _keeps_apart(here),
            f"r(3,5) = {SIMILARITY[2, 4]:.4f} links 3 and 5 directly up to that level",
        ),
        told(
            "combinations left after screening",
            "2^p − 1",
            f"{2 ** len(REPRESENTATIVES) - 1} instead of {2 ** len(SENSORS) - 1} (of 37 sensors: {2**37 - 1:,})",
            True,
            "non-empty subsets of p = 3 representatives; counts are exact",
        ),
    ]


def representative_lines(rises: NDArray[np.float64], z: NDArray[np.float64], y: NDArray[np.float64]) -> list[AuditLine]:
    """Which sensor of each group of the cut correlates best with each displacement [µm], P step 4."""
    lines = []
    for response, values in (("Z", z), ("Y", y)):
        r = np.array([np.corrcoef(column, values)[0, 1] for column in rises.T])
        best = [max(group, key=lambda k: abs(r[k])) for group in lambda_cut(SIMILARITY, LEVEL).members]
        ours = tuple(SENSORS[k] for k in best)
        lines.append(
            judged(
                "groups",
                f"representatives by correlation with {response}",
                ", ".join(REPRESENTATIVES),
                ", ".join(f"{SENSORS[k]} (r = {r[k]:.4f})" for k in best),
                ours == REPRESENTATIVES,
                f"best of each of the {len(best)} groups; on the reconstruction r = "
                + ", ".join(f"{r[k]:.4f} ({name})" for k, name in enumerate(SENSORS))
                + ". Two groups give two representatives, never three"
                + (
                    ". Sensor 4, near both bearings, follows Z = 6.05 X1 + 2.67 X2 more closely than sensor 1 unless "
                    "sensor 1 spreads at least 1.87 times as much as sensor 3 (R and the formula; residual neglected)"
                    if response == "Z"
                    else ""
                ),
            )
        )
    return lines


def _pairs() -> list[tuple[int, int]]:
    return [(a, b) for a in range(len(SENSORS)) for b in range(a + 1, len(SENSORS))]


def _twice(matrix: NDArray[np.float64], a: int, b: int) -> str:
    first, second = f"{matrix[a, b]:.4f}", f"{matrix[b, a]:.4f}"
    return first if first == second else f"{first} and {second}"


def _same(printed: float, ours: float) -> bool:
    return abs(printed - ours) <= ENTRY_HALF_UNIT


def _keeps_apart(step: LambdaStep) -> bool:
    group = {name: i for i, names in enumerate(step.partition.groups) for name in names}
    return len({group[name] for name in REPRESENTATIVES}) == len(REPRESENTATIVES)


def _listed(groups: tuple[tuple[str, ...], ...]) -> str:
    return " ".join("{" + ",".join(name[1:] for name in group) + "}" for group in groups)


BEARING_RISE_K = (6.0, 10.0)

CLAIMED_PERCENT = (80.0, 90.0)


def effect_lines(rises: Mapping[str, Vector]) -> list[AuditLine]:
    """The claim "80–90 % less" against the printed micrometres, and the other printed effects; rises [K]."""
    told, open_line = partial(judged, "effects"), partial(AuditLine, "effects")
    low, high = CLAIMED_PERCENT
    lines = []
    for item, before, after in (
        ("Z, largest, compensated", 100.0, (10.0,)),
        ("Z, mean of the warm phase, compensated", 80.0, (6.0, 8.0)),
        ("Y, mean, compensated", 41.0, (8.0,)),
        ("Z, largest, oil cooler alone", 100.0, (70.0,)),
        ("Z, mean of the warm phase, oil cooler alone", 80.0, (65.0,)),
        ("Y, mean, oil cooler alone", 41.0, (19.0,)),
        ("Y, largest, oil cooler alone", 56.0, (25.0,)),
    ):
        less = sorted(100 * (1 - value / before) for value in after)
        ours = "–".join(f"{value:.1f}" for value in less) + " % less"
        micrometres = f"{before:g} → {'–'.join(f'{value:g}' for value in after)} µm"
        if "oil" in item:
            worse = less[-1] < low
            lines.append(told(item, micrometres, ours, worse, "less than compensation reaches, as the patent says"))
            continue
        holds = low <= less[0] and less[-1] <= high + 1e-9
        lines.append(
            told(
                item,
                f"{micrometres}, {low:g}–{high:g} % less",
                ours,
                holds,
                "within the claimed range" if holds else "the printed micrometres give more than the claim",
                no="in tension",
            )
        )
    residual = 50.0 * (1 - PAIRS[0].r2) ** 0.5
    return [
        *lines,
        *_reach_lines(),
        open_line(
            "Y, largest",
            "56 µm",
            f"at most {_reach(Y_TWO_SENSORS):.1f} µm for the mean of both gauges",
            "cannot be checked",
            "the printed model is for the mean; one gauge may reach 56 µm, and the patent speaks of 25–56 µm",
        ),
        told(
            "error after compensation against R² 0.9989",
            "6–8 µm on average",
            f"R² 0.9989 leaves at most {residual:.1f} µm rms",
            residual >= 6.0,
            "values between 0 and 100 µm have a standard deviation of at most 50 µm, and R² leaves √(1 − R²) of it. "
            "R² speaks of the data that it was fitted to; on the next run the error is several times larger",
            no="in tension",
        ),
        told(
            "Y, mean of the warm phase, against both gauges",
            "41 µm; Y reaches 25–56 µm",
            "at most 40.5 µm for the mean of gauges that reach 25 and 56 µm",
            False,
            "if 25 and 56 µm are what the lower and the upper gauge reach (figure 7), the mean over the warm phase is "
            "at the largest value; 41 is printed as 0.041 mm, so up to rounding both can hold",
            no="in tension",
        ),
        open_line(
            "protocol",
            "1500 → 3000 r/min in steps, feed 2000 mm/min, 6–8 h; bearings rise 6–10 K",
            f"bearings of the reconstruction rise {rises['T1'].max():.1f} and {rises['T3'].max():.1f} K",
            "cannot be checked",
            "the reconstruction follows it with four steps in 8 h; the steps and the sampling period are not printed",
        ),
    ]


def symbol_lines(rises: Mapping[str, Vector], z: Vector) -> list[AuditLine]:
    """Symbols that are used for other things than they are defined as, contradiction (c); rises [K], z [µm]."""
    told = partial(judged, "symbols")
    columns = np.column_stack([np.ones(len(z)), rises["T1"], rises["T3"]])
    fitted = columns @ np.linalg.lstsq(columns, z, rcond=None)[0]
    sst, ssr, sse = (float(v @ v) for v in (z - z.mean(), fitted - z.mean(), z - fitted))
    penalty = (len(z) - 1) / (len(z) - columns.shape[1])
    about = columns[:, 1:] - columns[:, 1:].mean(axis=0)
    solved = np.linalg.solve(about.T @ about, about.T @ z)
    gradient = float(np.abs(columns.T @ (z - fitted)).max())
    two_ways = 1 - penalty * sse / sst, 1 - penalty * (1 - ssr / sst)
    return [
        told(
            "SSE = SST − SSR",
            "an identity",
            f"{sse:.4f} = {sst:.4f} − {ssr:.4f}",
            bool(np.isclose(sse, sst - ssr, rtol=1e-8)),
            "two-sensor fit of Z on the reconstruction; without an intercept the identity fails, and adjusted R² "
            "needs another definition",
        ),
        told(
            "eq. 2: 1 − (m−1)/(m−p−1)·SSE/SST = 1 − (m−1)/(m−p−1)·(1 − R²)",
            "an identity",
            f"{two_ways[0]:.10f} and {two_ways[1]:.10f}",
            bool(np.isclose(*two_ways, rtol=0, atol=1e-10)),
            "the same fit, with m observations and p regressors beside the intercept",
        ),
        told(
            "(c) eq. 7: ∂θ/∂b, sums over i of terms in t",
            "Σ over i = 1…N of (y_t − b0 − …)·x_ij",
            f"∂Q/∂b_j = −2 Σ over t of (y_t − b0 − …)·x_tj, {'0' if gradient < 1e-6 else f'{gradient:.0e}'} at the fit",
            False,
            "Q of eq. 6 is called θ and its index of samples t is called i; with t the equations are the normal "
            "equations, which the fit of Z on the reconstruction solves",
        ),
        told(
            "(c) eq. 10: x_ii, x_ij",
            "l_ij = Σ (x_ii − x̄_i)(x_ij − x̄_j)",
            f"l_ij = Σ over t of (x_ti − x̄_i)(x_tj − x̄_j); b = {solved[0]:.4f}, {solved[1]:.4f}",
            False,
            "the first index is that of the samples, as in its own last member; with it eq. 11 gives the two-sensor "
            "model of Z on the reconstruction",
        ),
    ]


def _reach_lines() -> list[AuditLine]:
    lines, told = [], partial(judged, "effects")
    for item, printed_um, model in (
        ("Z, largest", 100.0, Z_TWO_SENSORS),
        ("Z, mean of the warm phase", 80.0, Z_TWO_SENSORS),
        ("Y, mean of the warm phase", 41.0, Y_TWO_SENSORS),
    ):
        reach = _reach(model)
        lines.append(
            told(
                f"{item}, with bearings that rise 6–10 K",
                f"{printed_um:g} µm",
                f"at most {reach:.1f} µm",
                reach >= printed_um,
                f"the printed two-sensor model of {model.direction} at its best corner of 6–10 K"
                + ("" if reach >= printed_um else "; that run was warmer, or the model does not hold for it"),
                no="in tension",
            )
        )
    return lines


def _reach(model: PrintedModel) -> float:
    """Largest displacement [µm] that a two-sensor model gives while both bearings rise 6–10 K."""
    corners = np.array([[1.0, a, b] for a in BEARING_RISE_K for b in BEARING_RISE_K])
    return float((corners @ model.coefficients).max())
