"""Whether a group of sensors deserves its name: scatter within and between groups, and chains."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import fdtrc

from selector.errors import InputError
from selector.findings import Finding
from selector.sensors.fuzzy import ClosureChain, closure_chain
from selector.sensors.similarity import DUPLICATE_TOLERANCE

if TYPE_CHECKING:
    from selector.sensors.groups import Partition


@dataclass(frozen=True)
class FStatistic:
    """Scatter between groups over scatter within groups, see `f_statistic`; infinite when groups have no scatter."""

    value: float
    p_value: float
    between_df: int
    within_df: int


def f_statistic(similarity: ArrayLike, partition: Partition) -> FStatistic | None:
    """F of a partition of n sensors into r groups: between-group over within-group scatter, r − 1 and n − r degrees.

    Each sensor is taken as its standardised series, a unit vector, so that |x_i − x_j|² = 2(1 − s_ij) and no samples
    are needed: within = Σ_g (n_g − Σ_{i,j∈g} s_ij / n_g), total = n − Σ s_ij / n, between = total − within.

    None for one group and for n groups. The p-value is a heuristic for ranking cuts, not a test: the groups were made
    from the same data, a sensor is a whole series rather than one number, and neighbouring sensors are not
    independent. With |r| as similarity there need not be such vectors, and F may even be negative.

    Raises
    ------
    InputError
        The partition is not one of these sensors, or as for `selector.sensors.fuzzy.closure_chain`.
    """
    s = np.asarray(similarity, dtype=np.float64)
    closure_chain(s)
    _same_size(s, partition)
    n = len(s)
    within = sum(len(group) - float(s[np.ix_(group, group)].sum()) / len(group) for group in partition.members)
    return f_of_scatter(n - float(s.sum()) / n, within, n, len(partition.members))


def f_of_scatter(total: float, within: float, n_sensors: int, n_groups: int) -> FStatistic | None:
    """F from the total and the within-group scatter; None for one group and for n groups."""
    if n_groups in (1, n_sensors):
        return None
    between = total - within
    # exact duplicates scatter by rounding alone
    if within <= n_sensors * DUPLICATE_TOLERANCE:
        return FStatistic(math.inf, 0.0, n_groups - 1, n_sensors - n_groups)
    value = (between / (n_groups - 1)) / (within / (n_sensors - n_groups))
    p_value = float(fdtrc(n_groups - 1, n_sensors - n_groups, value)) if value > 0 else 1.0
    return FStatistic(float(value), p_value, n_groups - 1, n_sensors - n_groups)


def chaining_findings(
    similarity: ArrayLike, partition: Partition, *, distance_ratio: float = 2.0
) -> tuple[Finding, ...]:
    """A finding `chaining` for every group that hangs together only through links.

    Said of a group whose least similar pair lies further apart than `distance_ratio` times what λ allows to
    neighbours, where the distance of two sensors is √(2(1 − s)). At ratio 2 not even one common neighbour could
    explain it (triangle inequality); three links at least were needed.

    Raises
    ------
    InputError
        As for `f_statistic`.
    """
    s = np.asarray(similarity, dtype=np.float64)
    chain = closure_chain(s)
    _same_size(s, partition)
    position = np.argsort(chain.order)
    findings = []
    for group in partition.members:
        block = s[np.ix_(group, group)]
        p, q = np.unravel_index(int(np.argmin(block)), block.shape)
        i, j, smallest = group[p], group[q], float(block[p, q])
        # 1e-12: similarities that differ from 1 by rounding alone are no chain at λ = 1
        if 1 - smallest <= distance_ratio**2 * (1 - partition.level) + 1e-12:
            continue
        a, b = sorted((int(position[i]), int(position[j])))
        joined_at = float(chain.levels[a:b].min())
        path = [partition.names[sensor] for sensor in _path(chain, i, j)]
        findings.append(
            Finding(
                id="chaining",
                level="warning",
                statement=f"At λ = {partition.level:g} a group of {len(group)} of {len(s)} sensors hangs together only "
                f"through links: its least similar pair, {path[0]} and {path[-1]}, has similarity {smallest:.4f}, and "
                f"{len(path) - 1} links join the two ({len(partition.members)} groups in all).",
                evidence={
                    "lambda": partition.level,
                    "group": [partition.names[sensor] for sensor in group],
                    "sensors": len(group),
                    "groups": len(partition.members),
                    "pair": [path[0], path[-1]],
                    "smallest_similarity": smallest,
                    "path": path,
                    "parts_above": joined_at,
                },
                suggestion=f"choose λ above {joined_at:.6g}, where {path[0]} and {path[-1]} part, or λ = auto",
            )
        )
    return tuple(findings)


def _path(chain: ClosureChain, i: int, j: int) -> list[int]:
    """Sensors from i to j along the maximum spanning tree."""
    parent = dict(zip(chain.order[1:].tolist(), chain.parents.tolist(), strict=True))
    up = [i]
    while up[-1] in parent:
        up.append(parent[up[-1]])
    down = [j]
    while down[-1] not in up:
        down.append(parent[down[-1]])
    return up[: up.index(down[-1])] + down[::-1]


def _same_size(similarity: NDArray[np.float64], partition: Partition) -> None:
    if len(partition.labels) != len(similarity):
        raise InputError(
            f"a partition of {len(partition.labels)} sensors and a similarity of {len(similarity)}",
            expected="both of the same sensors",
            where="partition",
            advice="cut the partition from this similarity",
        )
