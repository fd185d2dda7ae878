"""Which sensor stands for its group, round after round."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError, OptionError
from selector.findings import Finding, Where
from selector.sensors.finding_table import FINDINGS, ROUND_WITHOUT_EFFECT
from selector.sensors.groups import FuzzyGroups, Partition, closure_chain, lambda_cut, transitive_closure
from selector.sensors.similarity import sensor_names
from selector.types import Array


@dataclass(frozen=True)
class Dropped:
    """A sensor that a round lets go: who stands for it (None: nobody), and why, in plain words."""

    sensor: int
    stands_in: int | None
    reason: str


@dataclass(frozen=True)
class ScreeningRound:
    """One round of screening; sensors are indices into the full similarity."""

    level: float  #: The λ of this round
    kept: tuple[int, ...]  #: Sensors that entered the round, ascending; `partition` is over these, in this order
    partition: Partition  #: Their groups
    representatives: tuple[int, ...]  #: Sensors that leave the round, in order of their groups
    dropped: tuple[Dropped, ...]  #: All the others, each with a reason
    findings: tuple[Finding, ...] = ()  #: `round-without-effect`, `constant-must`

    @property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """The groups as indices into the full similarity."""
        return tuple(tuple(self.kept[i] for i in group) for group in self.partition.members)


def representatives(
    partition: Partition, relevance: ArrayLike, must: Iterable[int] = (), never: Iterable[int] = ()
) -> tuple[int, ...]:
    """The sensor of greatest relevance from each group, P step 4; ties go to the first.

    Relevance, shape (n_sensors,), is how much a sensor says about the displacement, e.g. |r| with it, or the mean r²
    over several responses. Sensors in `must` represent their group whatever their relevance, also several in one
    group; those in `never` represent none, and a group of such sensors alone ends without a representative.

    Raises InputError: relevance is missing or not finite for a sensor (give 0 to a sensor that cannot be compared).
    Raises OptionError: a sensor is in both lists, or there is no such sensor.
    """
    n = len(partition.labels)
    values = _checked_relevance(relevance, n)
    wanted, barred = _checked_options(must, never, n)
    chosen: list[int] = []
    for group in partition.members:
        fixed = [sensor for sensor in group if sensor in wanted]
        free = [sensor for sensor in group if sensor not in barred]
        # max returns the first of equals
        chosen += fixed or ([max(free, key=lambda sensor: values[sensor])] if free else [])
    return tuple(chosen)


def screen(
    similarity: ArrayLike,
    relevance: ArrayLike,
    levels: Sequence[float],
    must: Iterable[int] = (),
    *,
    constant: Iterable[int] = (),
    names: Sequence[str] = (),
) -> tuple[ScreeningRound, ...]:
    """Rounds of screening, P step 4: group, keep the representatives, regroup those. One round per level.

    A round at the level of the round before, or a higher one, drops nothing (docs/explanation/closure-and-cuts.md,
    *Rounds*) and says so in the finding `round-without-effect`.

    `levels` are the λ of each round, `must` is as for `representatives`; sensors that do not move (`constant`)
    represent nothing and are dropped in the first round unless in `must`.

    Raises InputError or OptionError as for `representatives` and `lambda_cut`; or there is no level.
    """
    s = np.asarray(similarity, dtype=np.float64)
    n = len(closure_chain(s).order)
    values = _checked_relevance(relevance, n)
    wanted, idle = (_checked_options(sensors, (), n)[0] for sensors in (must, constant))
    label = sensor_names(names, n)
    if len(levels) == 0:
        raise OptionError(
            "no level", expected="one λ for each round", where="levels of screening", advice="give one λ at least"
        )
    rounds: list[ScreeningRound] = []
    kept = tuple(range(n))
    for level in levels:
        if not kept:
            break
        partition = lambda_cut(s[np.ix_(kept, kept)], level, [label[i] for i in kept])
        done = _round(s, values, partition, kept, wanted, idle - wanted, label)
        if not rounds:
            unmoved = (_constant_must(label[i]) for i in sorted(wanted & idle))
            done = replace(done, findings=(*unmoved, *done.findings))
        rounds.append(done)
        kept = tuple(sorted(done.representatives))
    return tuple(rounds)


def fuzzy_round(
    similarity: ArrayLike,
    relevance: ArrayLike,
    fuzzy: FuzzyGroups,
    must: Iterable[int] = (),
    *,
    constant: Iterable[int] = (),
    names: Sequence[str] = (),
) -> ScreeningRound:
    """The one round of fuzzy groups: each sensor counts to the group in which its membership is largest.

    Arguments and errors as for `screen`.
    """
    s = np.asarray(similarity, dtype=np.float64)
    n = len(fuzzy.memberships)
    wanted, idle = (_checked_options(sensors, (), n)[0] for sensors in (must, constant))
    label, kept = sensor_names(names, n), tuple(range(n))
    done = _round(s, _checked_relevance(relevance, n), fuzzy.partition, kept, wanted, idle - wanted, label, fuzzy)
    return replace(done, findings=tuple(_constant_must(label[i]) for i in sorted(wanted & idle)))


def _round(
    s: Array,
    values: Array,
    partition: Partition,
    kept: tuple[int, ...],
    must: frozenset[int],
    idle: frozenset[int],
    label: tuple[str, ...],
    fuzzy: FuzzyGroups | None = None,
) -> ScreeningRound:
    among, level = s[np.ix_(kept, kept)], partition.level
    local = representatives(
        partition,
        values[list(kept)],
        [i for i, sensor in enumerate(kept) if sensor in must],
        [i for i, sensor in enumerate(kept) if sensor in idle],
    )
    closure = transitive_closure(among)
    dropped = []
    for i in sorted(set(range(len(kept))) - set(local)):
        candidates = [j for j in local if partition.labels[j] == partition.labels[i]]
        reasons = []
        if kept[i] in idle:
            reasons.append("it does not move in these recordings, so it can stand for nothing")
        by = max(candidates, key=lambda j: among[i, j], default=None)  # the first of equals
        if by is not None:
            direct, linked = float(among[i, by]), float(closure[i, by])
            through = links = ""
            if fuzzy is not None:
                said = f"{direct:.4f}, membership {fuzzy.memberships[i, partition.labels[i]]:.2f}"
            else:
                links = "" if direct >= level else f", but t = {_compared(linked, level)}"
                through, said = " through links" if links else "", _compared(direct, level)
            reasons.append(f"{label[kept[by]]} stands for it{through}: r = {said}{links}")
        dropped.append(Dropped(kept[i], None if by is None else kept[by], "; ".join(reasons)))
    findings = () if dropped or fuzzy is not None else (_without_effect(level, closure),)
    return ScreeningRound(float(level), kept, partition, tuple(kept[i] for i in local), tuple(dropped), findings)


def _without_effect(level: float, closure: Array) -> Finding:
    n = len(closure)
    below = closure[closure < level]
    nearest = float(below.max()) if below.size and below.max() >= 0.0 else None
    told = f"Screening {n} sensor{'s' * (n > 1)} at λ = {level:g} drops none: no two of them that could be merged are "
    told += "linked at this level. Sensors kept by an earlier round at the same or a lower λ never merge again."
    evidence = {"lambda": float(level), "sensors": n, "next_level": nearest}
    # rounded down, so that the level suggested does merge
    lower = "" if nearest is None else f", or give it λ = {math.floor(nearest * 1e6) / 1e6:g} or less"
    return FINDINGS.finding(ROUND_WITHOUT_EFFECT, told, evidence=evidence, suggestion=f"leave the round out{lower}")


def _constant_must(name: str) -> Finding:
    told = f"{name} must be kept, but it does not move in these recordings: no model can use it."
    advice = f"take {name} off the must list, or record runs in which its place warms up"
    return FINDINGS.finding("constant-must", told, Where(channel=name), suggestion=advice)


def _compared(value: float, level: float) -> str:
    """The value beside λ with as many digits as it takes to read the comparison right."""
    holds, shown = value >= level, f"{level:.6g}"
    sign = "≥" if holds else "<"
    for digits in range(4, 17):
        text = f"{value:.{digits}f}"
        if (float(text) >= float(shown)) == holds:
            return f"{text} {sign} λ = {shown}"
    return f"{value!r} {sign} λ = {level!r}"


def _checked_relevance(relevance: ArrayLike, n_sensors: int) -> Array:
    values = np.asarray(relevance, dtype=np.float64)
    if values.shape != (n_sensors,) or not np.isfinite(values).all():
        raise InputError(
            f"relevance of shape {values.shape}, {int((~np.isfinite(values)).sum())} of them not finite",
            expected=f"{n_sensors} finite numbers, one per sensor",
            where="relevance of the sensors",
            advice="give 0 to a sensor that cannot be compared with the displacement",
        )
    return values


def _checked_options(
    must: Iterable[int], never: Iterable[int], n_sensors: int
) -> tuple[frozenset[int], frozenset[int]]:
    wanted, barred = frozenset(int(i) for i in must), frozenset(int(i) for i in never)
    unknown = sorted(i for i in wanted | barred if not 0 <= i < n_sensors)
    if unknown:
        raise OptionError(
            f"sensors {unknown}",
            expected=f"indices from 0 to {n_sensors - 1}",
            where="must and never",
            advice="name sensors that are in the recording",
        )
    if wanted & barred:
        raise OptionError(
            f"sensors {sorted(wanted & barred)} are in both lists",
            expected="a sensor in one of the two at most",
            where="must and never",
            advice="take them off one of the lists",
        )
    return wanted, barred
