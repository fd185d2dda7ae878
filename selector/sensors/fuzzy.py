"""How far a sensor belongs to a group: fuzzy c-means on the similarity."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import OptionError
from selector.findings import Finding, Where
from selector.sensors.finding_table import FINDINGS
from selector.sensors.groups import LambdaAxis, Partition, closure_chain
from selector.sensors.similarity import sensor_names
from selector.types import Array, Matrix

FUZZIFIER = 2.0  #: m of the objective Σ u^m d² (Bezdek); at 1 the groups would be crisp
HALF_AS_MUCH = 0.5  #: A sensor stands between two groups if the second has more than this share of the first
_MOST_STEPS, _CHANGE = 1000, 1e-9


@dataclass(frozen=True, eq=False)
class FuzzyGroups:
    """Sensors that belong to every group by a share, and the groups in which each has its largest."""

    memberships: Matrix  #: (n_sensors, n_groups): [-], each row adds up to 1; groups in the order of `partition`
    partition: Partition  #: Its level is the λ of the cut beside it, see `cut_beside`

    @property
    def fpc(self) -> float:
        """Fuzzy partition coefficient, Σ u² / n (Bezdek): 1 if crisp, 1 / n_groups if nothing can be told apart."""
        # to the last bit in whatever order they lie in memory
        return math.fsum((self.memberships**2).flat) / len(self.memberships)

    @property
    def crispness(self) -> float:
        """The coefficient from 0 (nothing told apart) to 1, which can be compared between numbers of groups (Dave)."""
        n = self.memberships.shape[1]
        return 1.0 if n == 1 else (n * self.fpc - 1.0) / (n - 1.0)

    @cached_property
    def between(self) -> tuple[tuple[int, int, int], ...]:
        """(sensor, its group, the other group) of all that belong to two groups nearly alike."""
        if self.memberships.shape[1] < 2:
            return ()
        order = np.argsort(-self.memberships, axis=1, kind="stable")
        return tuple(
            (i, int(first), int(second))
            for i, (first, second) in enumerate(order[:, :2])
            if self.memberships[i, second] > HALF_AS_MUCH * self.memberships[i, first]
        )

    def agreement(self, cut: Partition) -> float:
        """Share of the pairs of sensors that a cut, too, keeps together or apart (Rand); NaN of one sensor."""
        one, other = (np.equal.outer(labels, labels) for labels in map(np.array, (self.partition.labels, cut.labels)))
        pairs = np.triu_indices(len(one), 1)
        return float((one == other)[pairs].mean()) if len(pairs[0]) else float("nan")


def fuzzy_groups(similarity: ArrayLike, n_groups: int, names: Sequence[str] = (), level: float = 1.0) -> FuzzyGroups:
    """Fuzzy c-means (scikit-fuzzy) of sensors, from a similarity of shape (n_sensors, n_sensors).

    A sensor is its standardised series, a unit vector, of which the similarity is the matrix of scalar products:
    |x_i − x_j|² = 2(1 − s_ij). Its coordinates follow from the eigenvectors of the similarity, so that no samples are
    needed; |r| may have no such vectors, and what is negative then counts as zero. It starts from the groups of Ward's
    tree, so that nothing is drawn at random. Groups that no sensor has its largest membership in are left out.

    Errors as `closure_chain`. Raises OptionError: the number of groups is not from 1 to that of the sensors.
    """
    from scipy.cluster.hierarchy import fcluster, ward

    s = np.asarray(similarity, dtype=np.float64)
    n = len(closure_chain(s).order)
    if not 1 <= n_groups <= n:
        raise OptionError(
            f"{n_groups} groups of {n} sensors", expected=f"1 to {n} groups", where="fuzzy groups",
            advice="ask for fewer groups than sensors",
        )  # fmt: skip
    values, vectors = np.linalg.eigh(s)
    at = vectors * np.sqrt(np.maximum(values, 0.0))
    label = fcluster(ward(at), n_groups, criterion="maxclust") if n > 1 else np.ones(1, dtype=np.int32)
    memberships = (label[:, None] == np.unique(label)).astype(np.float64)
    # crisp where there is nothing to share out; copies of one signal leave fewer groups than were asked for
    if 1 < memberships.shape[1] < n:
        memberships = _c_means(at, memberships)
    found = memberships.argmax(axis=1)
    groups = list(dict.fromkeys(found.tolist()))
    kept = memberships[:, groups] / memberships[:, groups].sum(axis=1, keepdims=True)
    kept.setflags(write=False)
    return FuzzyGroups(kept, Partition(tuple(found.tolist()), level, sensor_names(names, n)))


def _c_means(at: Array, start: Array) -> Array:
    from skfuzzy.cluster import cmeans  # a third of a second

    _, shares, *_ = cmeans(at.T, start.shape[1], FUZZIFIER, _CHANGE, _MOST_STEPS, init=start.T.copy())
    return np.asarray(shares.T, dtype=np.float64)


def cut_beside(axis: LambdaAxis, n_groups: int) -> float:
    """λ of the cut with this number of groups, or of the one that comes nearest from below."""
    counts = [len(step.partition.members) for step in axis]
    return axis.highs[min(range(len(counts)), key=lambda k: (abs(counts[k] - n_groups), counts[k]))]


def between_finding(fuzzy: FuzzyGroups) -> tuple[Finding, ...]:
    """The finding `between-groups` of all sensors that belong to two groups nearly alike.

    A group is called after the sensor that belongs to it most.
    """
    names, shares = fuzzy.partition.names, fuzzy.memberships
    core = [names[i] for i in shares.argmax(axis=0)]
    told = [
        f"{names[i]} ({shares[i, first]:.2f} with {core[first]}, {shares[i, second]:.2f} with {core[second]})"
        for i, first, second in fuzzy.between
    ]
    if not told:
        return ()
    one = len(told) == 1
    statement = f"{', '.join(told)} {'stands' if one else 'stand'} between two of {len(core)} fuzzy groups."
    evidence = {"sensors": [names[i] for i, _, _ in fuzzy.between], "groups": len(core), "fpc": fuzzy.fpc}
    where = Where(channel=names[fuzzy.between[0][0]]) if one else Where()
    return (FINDINGS.finding("between-groups", statement, where, evidence=evidence),)
