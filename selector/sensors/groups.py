"""Which sensors hang together through others (max–min closure), the groups at every level λ, and fuzzy groups."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.cluster.hierarchy import cophenet, leaves_list, linkage
from scipy.sparse.csgraph import breadth_first_order
from scipy.spatial.distance import squareform
from scipy.special import fdtrc, fdtri

from selector.errors import InputError, OptionError
from selector.findings import Finding, Where
from selector.sensors.finding_table import FINDINGS
from selector.sensors.similarity import DUPLICATE_TOLERANCE, sensor_names
from selector.types import Array, Indices, Mask, Matrix


@dataclass(frozen=True, eq=False)
class ClosureChain:
    """The whole closure of a relation over n sensors in 2n − 1 numbers.

    For positions a < b, t(order[a], order[b]) = min(levels[a], …, levels[b − 1]).
    """

    #: (n,): Sensors; groups of every λ-cut are contiguous here, so it is also a leaf order of the dendrogram
    order: Indices
    #: (n − 1,): Closure of order[k] and order[k + 1]; each is bit-equal to an entry of the relation
    levels: Array


def closure_chain(r: ArrayLike) -> ClosureChain:
    """The closure of a similarity relation as a chain, in O(n²); see `ClosureChain` for its meaning.

    It has shape (n_sensors, n_sensors), is exactly symmetric with unit diagonal, its entries within [-1, 1].

    Anything else raises InputError, NaN too: an unknown similarity is neither 0 nor 1.
    """
    tree = dendrogram(r)
    n = len(tree.leaf_order)
    order, levels = np.array(tree.leaf_order, dtype=np.int64), np.empty(n - 1)
    # two groups that merge stand one behind the other: where does each end?
    end = {sensor: k for k, sensor in enumerate(tree.leaf_order)}
    for k, (first, second) in enumerate(tree.linkage[:, :2].astype(np.int64).tolist()):
        levels[end[first]], end[n + k] = tree.levels[k], end[second]
    return ClosureChain(_read_only(order), _read_only(levels))


def transitive_closure(r: ArrayLike) -> Matrix:
    """Smallest max–min transitive relation that contains r, P step 2, shape (n_sensors, n_sensors), read-only.

    t_ij is the widest bottleneck over all paths from i to j: the level at which single linkage joins the two. Nothing
    is computed but comparisons, so that every entry is bit-equal to an entry of r. O(n²) time, against O(n³ log n) of
    the squaring in the source; negative entries are welcome. Errors as `closure_chain`.
    """
    tree = dendrogram(r)
    if len(tree.levels) == 0:
        return _read_only(np.ones((1, 1)))
    # the numbers of the merges as heights: heights of their own would be rounded
    merges = tree.linkage.copy()
    merges[:, 2] = np.arange(len(merges))
    closure = squareform(tree.levels[cophenet(merges).astype(np.int64)])
    np.fill_diagonal(closure, 1.0)
    return _read_only(closure)


def _read_only(values: NDArray[Any]) -> NDArray[Any]:
    values.setflags(write=False)
    return values


def _relation(r: ArrayLike) -> Matrix:
    """r, checked."""
    relation = np.asarray(r, dtype=np.float64)
    if relation.ndim != 2 or relation.shape[0] != relation.shape[1] or np.ndim(r) != 2 or relation.shape[0] == 0:
        raise _unusable(f"an array of shape {np.shape(r)}", "a square matrix with at least one sensor")
    # written so that NaN counts as a flaw
    flaws = ~((relation == relation.T) & (relation >= -1.0) & (relation <= 1.0))
    np.fill_diagonal(flaws, np.diag(relation) != 1.0)
    if not flaws.any():
        return relation
    i, j = np.argwhere(flaws)[0].tolist()
    here, there = float(relation[i, j]), float(relation[j, i])
    if not (np.isfinite(here) and np.isfinite(there)):
        raise _unusable(f"{here} at ({i}, {j}) and {there} at ({j}, {i})", "finite entries")
    if i == j:
        raise _unusable(f"{here!r} on the diagonal, sensor {i}", "exactly 1: every sensor is like itself")
    if here != there:
        raise _unusable(f"{here!r} at ({i}, {j}) but {there!r} at ({j}, {i})", "an exactly symmetric matrix")
    raise _unusable(f"{here!r} at ({i}, {j})", "entries within [-1, 1]")


def _unusable(found: str, expected: str) -> InputError:
    return InputError(
        found,
        expected=expected,
        where="similarity relation",
        advice="make the matrix with selector.sensors.correlation_similarity or similarity_from_cross_products",
    )


@dataclass(frozen=True)
class FStatistic:
    """F of n sensors in r groups: scatter between over scatter within groups, with r − 1 and n − r degrees of freedom.

    From the similarities alone, as docs/explanation/closure-and-cuts.md derives it. Infinite when groups have no
    scatter; with |r| as similarity it may be negative. The p-value is a heuristic for ranking cuts, not a test.
    """

    value: float
    p_value: float
    between_df: int
    within_df: int


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


CHAIN_RATIO = 2.0  #: How many times farther apart than λ allows to neighbours the ends of a chain are.


def chaining_findings(similarity: ArrayLike, partition: "Partition") -> tuple[Finding, ...]:
    """A finding `chaining` for every group that hangs together only through links.

    Said of a group whose least similar pair lies further apart than `CHAIN_RATIO` times what λ allows to neighbours,
    where the distance of two sensors is √(2(1 − s)).

    Raises InputError: the partition is not one of these sensors, or as for `closure_chain`.
    """
    s = np.asarray(similarity, dtype=np.float64)
    closure = transitive_closure(s)
    _same_size(s, partition)
    findings = []
    for group in partition.members:
        block = s[np.ix_(group, group)]
        p, q = np.unravel_index(int(np.argmin(block)), block.shape)
        i, j, smallest = group[p], group[q], float(block[p, q])
        # 1e-12: similarities that differ from 1 by rounding alone are no chain at λ = 1
        if 1 - smallest <= CHAIN_RATIO**2 * (1 - partition.level) + 1e-12:
            continue
        joined_at = float(closure[i, j])
        path = [partition.names[sensor] for sensor in _path(s >= joined_at, i, j)]
        told = f"At λ = {partition.level:g} a group of {len(group)} of {len(s)} sensors hangs together only through "
        told += f"links: its least similar pair, {path[0]} and {path[-1]}, has similarity {smallest:.4f}, and "
        told += f"{len(path) - 1} links join the two ({len(partition.members)} groups in all)."
        evidence = {
            "lambda": partition.level,
            "group": [partition.names[sensor] for sensor in group],
            "sensors": len(group),
            "groups": len(partition.members),
            "pair": [path[0], path[-1]],
            "smallest_similarity": smallest,
            "path": path,
            "parts_above": joined_at,
        }
        advice = f"choose λ above {joined_at:.6g}, where {path[0]} and {path[-1]} part, or λ = auto"
        findings.append(FINDINGS.finding("chaining", told, evidence=evidence, suggestion=advice))
    return tuple(findings)


def _path(linked: Mask, i: int, j: int) -> list[int]:
    """Sensors from i to j over the fewest links."""
    before, path = breadth_first_order(linked.astype(np.float64), i)[1], [j]
    while path[-1] != i:
        path.append(int(before[path[-1]]))
    return path[::-1]


def _same_size(similarity: Array, partition: "Partition") -> None:
    if len(partition.labels) != len(similarity):
        raise InputError(
            f"a partition of {len(partition.labels)} sensors and a similarity of {len(similarity)}",
            expected="both of the same sensors",
            where="partition",
            advice="cut the partition from this similarity",
        )


@dataclass(frozen=True)
class Partition:
    """A division of n sensors into groups.

    Two partitions are equal when the same sensors are grouped in the same way, whatever the level.
    """

    #: Group of each sensor. Any labels may be given; they are numbered anew in first-seen order.
    labels: tuple[int, ...]
    level: float = field(compare=False)  #: The λ of the cut
    names: tuple[str, ...] = ()  #: Names of the sensors; x0, x1, … when none are given

    def __post_init__(self) -> None:
        numbers: dict[int, int] = {}
        labels = tuple(numbers.setdefault(int(label), len(numbers)) for label in self.labels)
        object.__setattr__(self, "labels", labels)
        object.__setattr__(self, "names", sensor_names(self.names, len(labels)))

    @cached_property
    def members(self) -> tuple[tuple[int, ...], ...]:
        """Indices of the sensors of each group, groups in order of their first sensor."""
        found: list[list[int]] = [[] for _ in range(len(set(self.labels)))]
        for sensor, label in enumerate(self.labels):
            found[label].append(sensor)
        return tuple(tuple(group) for group in found)

    @property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Names of the sensors of each group, groups in order of their first sensor."""
        return tuple(tuple(self.names[sensor] for sensor in group) for group in self.members)


@dataclass(frozen=True)
class LambdaStep:
    """All λ in (low, high] cut the same partition; `f` is None for one group and for n groups, where it has no sense.

    The lowest step reaches down to −1 and includes it.
    """

    low: float
    high: float
    partition: Partition
    f: FStatistic | None


@dataclass(frozen=True)
class LambdaAxis:
    """Every distinct λ-cut, from the finest partition to one group; each is nested in the next.

    A row of `LambdaStep`, whose partitions are made when asked for. The finest partition is all sensors alone, unless
    some have similarity exactly 1.
    """

    order: tuple[int, ...]  #: Sensors such that the groups of every cut are contiguous
    levels: tuple[float, ...]  #: levels[k] is the closure level that links order[k] and order[k + 1]
    highs: tuple[float, ...]  #: Upper end of the λ-interval of each step, descending
    f_statistics: tuple[FStatistic | None, ...]  #: One per step
    names: tuple[str, ...]  #: Names of the sensors

    def __len__(self) -> int:
        return len(self.highs)

    def __getitem__(self, index: int) -> LambdaStep:
        i = range(len(self))[index]
        high = self.highs[i]
        labels = _labels_at(np.asarray(self.order), np.asarray(self.levels), high)
        low = self.highs[i + 1] if i + 1 < len(self) else -1.0
        return LambdaStep(low, high, Partition(labels, high, self.names), self.f_statistics[i])

    def __iter__(self) -> Iterator[LambdaStep]:
        return (self[i] for i in range(len(self)))

    def at(self, level: float) -> LambdaStep:
        """The step whose interval holds λ = `level`."""
        _checked_level(level)
        return self[max(i for i, high in enumerate(self.highs) if level <= high)]

    def strongest(self) -> LambdaStep | None:
        """The step whose F exceeds the critical value F_α(r − 1, n − r) most, (F − F_α) / F_α, α = 5 %; None if none.

        Infinite F (groups of exact duplicates) does not compete: remove duplicates first. A heuristic, as the
        p-value is: see `FStatistic`.
        """
        excess: dict[int, float] = {}
        for i, f in enumerate(self.f_statistics):
            if f is not None and math.isfinite(f.value):
                critical = float(fdtri(f.between_df, f.within_df, 0.95))
                excess[i] = (f.value - critical) / critical
        best = max(excess, key=lambda i: excess[i], default=None)
        return self[best] if best is not None and excess[best] > 0 else None


@dataclass(frozen=True, eq=False)
class Dendrogram:
    """Merges of groups as λ falls."""

    linkage: Array  #: (n_sensors − 1, 4): SciPy's linkage matrix, single linkage, heights 1 − level
    #: (n_sensors − 1,): Exact closure level of each merge, descending. Cut by these: 1 − (1 − level) has other bits
    #: than level.
    levels: Array
    leaf_order: tuple[int, ...]  #: Sensors from left to right, without crossings


def lambda_cut(similarity: ArrayLike, level: float, names: Sequence[str] = ()) -> Partition:
    """Groups of sensors with t_ij ≥ `level` in the transitive closure, P step 3.

    `similarity` of shape (n_sensors, n_sensors) may be the relation or its closure; the cut is the same. A cut exactly
    at a closure level is exact.

    Raises InputError as for `closure_chain`, OptionError: the level is not within [-1, 1].
    """
    _checked_level(level)
    chain = closure_chain(similarity)
    return Partition(_labels_at(chain.order, chain.levels, level), float(level), tuple(names))


def lambda_axis(similarity: ArrayLike, names: Sequence[str] = ()) -> LambdaAxis:
    """Every distinct λ-cut of a relation of shape (n_sensors, n_sensors), with its F-statistic; O(n²) for all.

    Errors as `selector.sensors.groups.closure_chain`.
    """
    s = np.asarray(similarity, dtype=np.float64)
    chain = closure_chain(s)
    n = len(chain.order)
    highs = sorted({1.0, *(float(level) for level in chain.levels)}, reverse=True)
    # groups are intervals of the chain: merging two adds one off-diagonal block to the sum inside groups
    ordered = s[np.ix_(chain.order, chain.order)]
    total = n - ordered.sum() / n
    stop_of = {start: start + 1 for start in range(n)}
    start_of = {stop: start for start, stop in stop_of.items()}
    inside = np.ones(n)
    within = 0.0
    merges = iter(np.argsort(-chain.levels, kind="stable"))
    waiting = next(merges, None)
    statistics: list[FStatistic | None] = []
    for high in highs:
        while waiting is not None and chain.levels[waiting] >= high:
            middle = int(waiting) + 1
            start, stop = start_of.pop(middle), stop_of.pop(middle)
            grown = inside[start] + inside[middle] + 2 * ordered[start:middle, middle:stop].sum()
            within += inside[start] / (middle - start) + inside[middle] / (stop - middle) - grown / (stop - start)
            inside[start], stop_of[start], start_of[stop] = grown, stop, start
            waiting = next(merges, None)
        statistics.append(f_of_scatter(total, within, n, len(stop_of)))
    return LambdaAxis(
        order=tuple(chain.order.tolist()),
        levels=tuple(chain.levels.tolist()),
        highs=tuple(highs),
        f_statistics=tuple(statistics),
        names=sensor_names(names, n),
    )


def dendrogram(similarity: ArrayLike) -> Dendrogram:
    """Single-linkage tree of a relation of shape (n_sensors, n_sensors), for figures.

    Errors as `selector.sensors.groups.closure_chain`.
    """
    relation = _relation(similarity)
    # SciPy makes no tree of one sensor
    tree = linkage(squareform(-relation, checks=False), "single") if len(relation) > 1 else np.empty((0, 4))
    levels = -tree[:, 2]
    tree[:, 2] = 1 - levels
    order = leaves_list(tree).tolist() if len(relation) > 1 else [0]
    return Dendrogram(_read_only(tree), _read_only(levels), tuple(order))


def _labels_at(order: Indices, levels: Array, level: float) -> tuple[int, ...]:
    labels = np.empty(len(order), dtype=np.int64)
    labels[order] = np.concatenate(([0], np.cumsum(levels < level)))
    return tuple(labels.tolist())


def _checked_level(level: float) -> None:
    if not -1 <= level <= 1:
        raise OptionError(
            f"λ = {level}",
            expected="a level within [-1, 1]; similarities lie there",
            where="λ",
            advice="choose a level such as 0.995, or auto",
        )


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
