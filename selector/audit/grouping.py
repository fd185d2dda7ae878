"""Whether the printed similarity, closure, cut and groups follow from one another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from selector.audit.printed import (
    CLOSURE,
    CUT_ROWS,
    ENTRY_HALF_UNIT,
    GROUPS_CLAIMED,
    LEVEL,
    REPRESENTATIVES,
    SENSORS,
    SIMILARITY,
    AuditLine,
    judged,
)
from selector.sensors.fuzzy import transitive_closure
from selector.sensors.groups import LambdaStep, lambda_axis, lambda_cut


def similarity_lines(rises: NDArray[np.float64]) -> list[AuditLine]:
    """R against the correlations of the reconstructed recording, `rises` of shape (n_samples, 8) [K]; P eq. 1."""
    found = np.asarray(np.corrcoef(rises, rowvar=False), dtype=np.float64)
    section = "similarity matrix R"
    lines = [
        judged(
            section,
            f"r({a + 1},{b + 1}) and r({b + 1},{a + 1})",
            _twice(SIMILARITY, a, b),
            f"{found[a, b]:.4f}",
            _same(SIMILARITY[a, b], found[a, b]) and _same(SIMILARITY[b, a], found[a, b]),
            "correlation of the reconstructed recording",
        )
        for a, b in _pairs()
    ]
    smallest = float(np.linalg.eigvalsh(SIMILARITY)[0])
    return [
        *lines,
        judged(section, "diagonal", "1.0000 eight times", "1", bool((np.diag(SIMILARITY) == 1).all()), "r(i,i) = 1"),
        judged(
            section,
            "symmetry",
            "28 pairs, each printed twice",
            f"{int((SIMILARITY != SIMILARITY.T).sum() // 2)} pairs differ",
            bool((SIMILARITY == SIMILARITY.T).all()),
            "a correlation matrix is symmetric",
        ),
        judged(
            section,
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
    section = "groups"
    partition = lambda_cut(SIMILARITY, LEVEL, SENSORS)
    steps = list(lambda_axis(SIMILARITY, SENSORS))
    here = next(step for step in steps if step.low < LEVEL <= step.high)
    threes = [step for step in steps if len(step.partition.groups) == GROUPS_CLAIMED]
    apart = [step for step in steps if _keeps_apart(step)]
    coarsest = apart[-1]
    return [
        judged(
            section,
            "(a) number of groups at λ = 0.995",
            f"{GROUPS_CLAIMED} groups",
            f"{len(partition.groups)} groups: {_listed(partition.groups)}",
            len(partition.groups) == GROUPS_CLAIMED,
            "counted in the printed cut itself: its rows have only "
            f"{len(set(CUT_ROWS))} different patterns. Every λ in ({here.low:.4f}, {here.high:.4f}] cuts the same",
        ),
        judged(
            section,
            "(a) three groups with 1, 3 and 5 apart, at any λ",
            "one representative from each of 3 groups",
            "; ".join(f"({s.low:.4f}, {s.high:.4f}]: {_listed(s.partition.groups)}" for s in threes) or "no such λ",
            any(_keeps_apart(step) for step in threes),
            "the only levels with three groups keep 3 and 5 together",
        ),
        judged(
            section,
            "(a) λ at which 1, 3 and 5 are apart",
            f"{LEVEL}",
            f"λ > {coarsest.low:.4f}; first in ({coarsest.low:.4f}, {coarsest.high:.4f}] with "
            f"{len(coarsest.partition.groups)} groups {_listed(coarsest.partition.groups)}",
            _keeps_apart(here),
            f"r(3,5) = {SIMILARITY[2, 4]:.4f} links 3 and 5 directly up to that level",
        ),
        judged(
            section,
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
