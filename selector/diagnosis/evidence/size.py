"""Which size of what is named, left or not found matters, and whether wrong parameters would do the same."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import compress

import numpy as np
from scipy import stats
from scipy.optimize import brentq

from selector.diagnosis.answer import Detectable, NamedEffect
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted
from selector.diagnosis.evidence.moments import solved
from selector.diagnosis.evidence.naming import is_structured, named_effect, noise_floor, seen_only
from selector.diagnosis.evidence.response import Bench
from selector.diagnosis.evidence.search import MOST_OF_IT, TENTH, Search, numbers, unseen_rms, without
from selector.diagnosis.evidence.testing import evidence_of, members_of, prices_of, tail_threshold, together
from selector.diagnosis.finding_table import FINDINGS, SMALL_MISFIT
from selector.diagnosis.matching.usable import pure_error, rms
from selector.diagnosis.shapes.axis import FORCE_ROLES, simulated_forces
from selector.diagnosis.shapes.force_response import PLACE_ROLES, passed
from selector.diagnosis.wording import amount, is_data
from selector.findings import Finding, Where
from selector.types import Vector

_HALF = 0.5  #: Sure at most, where wrong parameters do the same.
#: What parameters of a simulation of heat that are a few per cent off look like, and the part of the movement below
#: which it is no surer than they are likely: on 16 machines with values 2 and 5 % off it was 2 to 20 %.
_OF_HEAT = {"thermal.memory", "thermal.convection", "thermal.interaction", "thermal.speed_heating"}
_OF_MOVEMENT, _BEYOND = 0.25, 0.1  #: Its course, and what it does beyond recalibration.
#: Of the force that the simulation has of the same kind; of what a position is off its command.
_OF_FORCE, _OF_LOOP = 0.05, {"drive.delay", "drive.elasticity", "drive.mass"}
_MOST = 0.4
_LITTLE = 0.015  #: Of the movement of what is recorded: a mismatch that is practically none, however significant it is.
_NOTHING = 0.001  #: The same where what is left is noise, for all that is seen.
#: Of the movement: structure, and all that recalibration leaves, that are little beside what it puts right; what that
#: leaves of the error.
_LITTLE_BESIDE, _ALL_LEFT, _MUCH_SMALLER = 0.04, 0.1, 0.8
#: Times the pure error of repeats: what two recordings of the machine itself differ by.
_AS_REPEATED = float(np.sqrt(2.0))


def is_like_parameters(comparison: Comparison, found: Search, effect: NamedEffect) -> bool:
    """Whether wrong parameters of the simulation do the same as an effect, or as what it cannot be told from."""
    # no parameter is wrong in one run alone
    rivals = effect.cannot_be_told_from if effect.acts is None else ()
    if _OF_HEAT.isdisjoint((effect.id, *rivals)):
        return _is_little_beside_own(comparison, found, effect)
    bench, course = found.benches[effect.channel], effect.courses[effect.channel]
    moved = np.nanstd(comparison.recorded[effect.channel][bench.fitted])
    # a lag may take the place of the simulated course; what recalibration does not do by itself is little then
    beyond = np.sqrt(effect.share * bench.mean_square([]))
    return bool(np.std(course[bench.fitted]) < _OF_MOVEMENT * moved or beyond < _BEYOND * moved)


def or_parameters(comparison: Comparison, found: Search, effects: Sequence[NamedEffect]) -> Iterator[NamedEffect]:
    """Effects no surer than half where wrong parameters do the same, and told so.

    Physics that explains less of the same channel may be the rest of what is wrong with them, and is no surer either.
    """
    is_like = [is_like_parameters(comparison, found, effect) for effect in effects]
    like = list(compress(effects, is_like))
    for effect, is_one in zip(effects, is_like, strict=True):
        larger = (one for one in like if one.share > effect.share and not is_data(effect.id))
        if is_one:
            also = ", as parameters of the simulation that are a few per cent off would do, too."
            effect = replace(effect, statement=effect.statement.removesuffix(".") + also)
        is_rest = any(not set(one.channels).isdisjoint(effect.channels) for one in larger)
        yield replace(effect, confidence=min(effect.confidence, _HALF)) if is_one or is_rest else effect


def _is_little_beside_own(comparison: Comparison, found: Search, effect: NamedEffect) -> bool:
    """Whether an inertia or a friction is little beside that of the simulation, in a force that is compared.

    Or what a loop with other gains, or other steps, does is little beside what a position is off its command.
    """
    for name, v in found.named.get(effect.id, {}).items():
        channel = comparison.channel(name)
        if found.benches[name].candidates[v].variant.regime is not None:
            # no parameter is right in some runs
            return False
        fitted = found.benches[name].fitted
        own = simulated_forces(comparison, channel.axis).get(effect.id) if channel.role in FORCE_ROLES else None
        if own is not None:
            given = passed(comparison, name, own)[0]
            return rms(effect.courses[name][fitted]) < _OF_FORCE * rms(given[fitted])
        if name == effect.channel and effect.id in _OF_LOOP and _kept_at(comparison, name) is not None:
            is_error = channel.role == "displacement"
            off = np.nanstd(comparison.recorded[name][fitted]) if is_error else _movement(comparison, found, name)
            if rms(effect.courses[name][fitted]) < _OF_FORCE * off:
                return True
    return False


def of_practical_size(comparison: Comparison, found: Search) -> tuple[Search, tuple[NamedEffect, ...]]:
    """The search with names that matter alone, and those that are only seen, too.

    Where what is left is not noise alone, everything is significant: a mismatch of which names explain too little, or
    that does not matter, is something else. A frozen reading is proved by its equal readings.
    """
    trifles = {
        name for name, times in found.misfit.items() if _is_trifle(comparison, found, name, is_noise=times == 1.0)
    }
    doubted = {
        id_
        for id_, of in found.named.items()
        if id_ != "data.stuck"
        and (
            trifles.issuperset(of)
            or (_main(found, id_) in trifles and _most(found, id_, set(of) - trifles) < TENTH)
            or (all(found.misfit[name] > 1.0 for name in of) and max(_explained(comparison, found)) < _MOST)
            or all(_is_part_of_little(comparison, found, name) for name in of)
        )
    }
    also = {id_: of for id_, of in {**found.named, **found.small}.items() if id_ in doubted or id_ not in found.named}
    rest = replace(found, named={id_: of for id_, of in found.named.items() if id_ not in doubted})
    return rest, seen_only(_beside(comparison, found, id_, of) for id_, of in also.items())


def _main(found: Search, id_: str) -> str:
    """Of the responses that a name is of, the one that shows it most."""
    return max(found.named[id_], key=lambda name: found.standing[id_].tested[name].gain)


def _most(found: Search, id_: str, names: Iterable[str]) -> float:
    """The largest share that a name has of one of these responses."""
    others = without(found.named, id_)
    return max(found.benches[name].share(numbers(others, name), found.named[id_][name]) for name in names)


def _is_part_of_little(comparison: Comparison, found: Search, response: str) -> bool:
    """Whether names explain less than three quarters of a mismatch that is no noise, and little in one run.

    Or one that is no more than repeats of a programme differ by.
    """
    bench = found.benches[response]
    left = bench.mean_square(numbers(found.named, response)) / bench.mean_square([])
    if found.misfit[response] == 1.0 or left <= 1.0 - MOST_OF_IT:
        return False
    return is_little_in_one_run(comparison, found, response) or _is_as_repeated(comparison, found, response)


def _beside(comparison: Comparison, found: Search, id_: str, of: Mapping[str, int]) -> NamedEffect:
    """An effect as it stands beside the named ones."""
    beside = replace(
        found,
        named={**found.named, id_: dict(of)},
        rivals={id_: (), **found.rivals},
        weights={id_: {id_: _HALF}, **found.weights},
    )
    return named_effect(comparison, beside, id_)


def is_small(comparison: Comparison, found: Search, response: str, size: float = np.inf) -> bool:
    """Whether what recalibration leaves of a response, or structure of a `size` [unit] in it, is too little to matter.

    That is what repeats differ by as well, a step of the reading, a trifle of what was recorded; or little of it, where
    recalibration, which is to be done first, has made the error much smaller.
    """
    is_little = size < _LITTLE_BESIDE * _movement(comparison, found, response) and is_recalibrated(found, response)
    is_little &= _of_movement(comparison, found, response) < _ALL_LEFT
    is_little |= _off(found, response) < found.benches[response].resolution
    is_trifle = _is_trifle(comparison, found, response, is_noise=not is_structured(found, response))
    return is_little or is_trifle or _is_as_repeated(comparison, found, response)


def is_little_in_one_run(comparison: Comparison, found: Search, response: str) -> bool:
    """Whether less than a tenth of the movement is left, on unseen rows too, of a record of one run.

    Nothing in such a record tells noise that wanders, and a law that is not quite its own, from what comes again.
    """
    if np.ptp(found.benches[response].runs) > 0:
        return False
    return _off(found, response) < _ALL_LEFT * _movement(comparison, found, response)


def is_recalibrated(found: Search, response: str) -> bool:
    """Whether recalibration makes the error much smaller, in the rows that it is fitted to and in the others."""
    bench = found.benches[response]
    left, given = bench.residual([]), bench.given
    parts = [rows for rows in (bench.fitted, bench.unseen) if rows.any()]
    return all(rms(left[rows]) < _MUCH_SMALLER * rms(given[rows]) for rows in parts)


def _is_as_repeated(comparison: Comparison, found: Search, response: str) -> bool:
    repeated = pure_error(comparison, response)
    return repeated is not None and _off(found, response) < _AS_REPEATED * repeated


def _off(found: Search, response: str) -> float:
    """What the simulation is off in fitted or unseen rows, whichever is more; recalibrated or as given, if less."""
    bench = found.benches[response]
    recalibrated = max(float(np.sqrt(bench.mean_square([]))), unseen_rms(bench, []))
    as_given = np.nanmax([rms(bench.given[rows]) for rows in (bench.fitted, ~bench.fitted)])
    return min(recalibrated, float(as_given))


def _is_trifle(comparison: Comparison, found: Search, response: str, *, is_noise: bool) -> bool:
    least = _NOTHING if is_noise else _LITTLE
    return _of_movement(comparison, found, response) < least


def _kept_at(comparison: Comparison, response: str) -> str | None:
    """The command of a position that a control loop keeps."""
    of = comparison.channel(response)
    commands = comparison.with_role("position_command") if of.role in PLACE_ROLES else ()
    return next((name for name in commands if comparison.channel(name).axis == of.axis), next(iter(commands), None))


def told_of_small(comparison: Comparison, found: Search, small: frozenset[str]) -> tuple[Finding, ...]:
    """A finding for every response in which more is left than noise, but too little to matter, as in the `small`."""
    told = []
    for name in found.benches:
        if name not in small and not (is_structured(found, name) and is_small(comparison, found, name)):
            continue
        share = _of_movement(comparison, found, name)
        command = _kept_at(comparison, name)
        of = "its movement" if command is None else f"what it is off {command}"
        why = f"only {100.0 * share:.2g} % of {of} (rms)"
        if _is_as_repeated(comparison, found, name):
            why = "no more than repeats of a programme differ by"
        elif _off(found, name) < found.benches[name].resolution:
            why = "less than a step of the readings"
        elif share >= _LITTLE and is_little_in_one_run(comparison, found, name):
            why += ", and one run alone does not tell it from noise that wanders"
        elif not (is_small(comparison, found, name) or is_recalibrated(found, name)):
            why = "little beside it, and another in unseen rows"
        said = f"What recalibration leaves of {name} is no noise, but {why}: too little to be called missing physics."
        evidence = {"share_of_movement": share, "times_noise": found.misfit[name]}
        told.append(FINDINGS.finding(SMALL_MISFIT, said, Where(channel=name), evidence))
    return tuple(told)


def _movement(comparison: Comparison, found: Search, response: str) -> float:
    """How far a response moves, or a position is off a command; 0, unknown, beside commands of other axes or units."""
    of, command = comparison.recorded[response], _kept_at(comparison, response)
    fitted = found.benches[response].fitted
    moved = float(np.nanstd(of[fitted]))
    if command is None:
        return moved
    axes = {comparison.channel(name).axis for name in (response, command)} - {None}
    if len(axes) > 1 or comparison.channel(response).unit != comparison.channel(command).unit:
        return 0.0
    off = float(np.nanstd((of - comparison.recorded[command])[fitted]))
    return off if off < moved else 0.0


def _of_movement(comparison: Comparison, found: Search, response: str) -> float:
    whole = _movement(comparison, found, response)
    return float(np.sqrt(found.benches[response].mean_square([]))) / whole if whole > 0.0 else np.inf


def _explained(comparison: Comparison, found: Search) -> Iterator[float]:
    """Share of the mean square above the noise that the named effects explain, of every response that has one."""
    for name, bench in found.benches.items():
        named = numbers(found.named, name)
        if not named:
            continue
        alone, left = bench.mean_square([]), bench.mean_square(named)
        above = alone - noise_floor(comparison, bench, named, is_noise=found.misfit[name] == 1.0) ** 2
        yield (alone - left) / above if above > 0.0 else 1.0


_LEFT = 1e-3  #: Of the norm of a course: what recalibration leaves less of is not seen.
_CHANCE = 0.9


def detectability(comparison: Comparison, found: Search, *, false_alarm: float) -> tuple[Detectable, ...]:
    """Per effect that was tested and not named, the size that would have been found in 9 of 10 such records.

    The size is the root mean square of the effect's course in the response that shows it best, of its median shape.
    An effect whose whitened course, recalibration and named effects projected off, has the norm d gains χ² about d²,
    and as much of it by every other shape of the effect as that has in common with the course.
    """
    sizes: dict[str, Detectable] = {}
    spread = {name: float(np.nanstd(bench.target[bench.fitted])) for name, bench in found.benches.items()}
    for response, bench in found.benches.items():
        thresholds = {
            id_: tail_threshold(false_alarm, standing.noise)
            for id_, standing in found.standing.items()
            if response in standing.tested and id_ not in found.named
        }
        for one in _in_response(comparison, bench, numbers(found.named, response), thresholds):
            if one.id not in sizes or one.size / spread[response] < sizes[one.id].size / spread[sizes[one.id].channel]:
                sizes[one.id] = one
    return tuple(sizes[id_] for id_ in sorted(sizes))


def _in_response(
    comparison: Comparison, bench: Bench, named: list[int], thresholds: Mapping[str, float]
) -> Iterator[Detectable]:
    base = bench.base(named)
    sums = bench.moments(base)
    kept = np.linalg.qr(base)[0]
    prices, members = prices_of(bench), members_of(bench)
    unit = comparison.channel(bench.response).unit
    for id_, threshold in thresholds.items():
        shapes = []
        for v in members[id_]:
            first = bench.candidates[v].columns.start
            course = bench.white_columns[:, first] - kept @ (kept.T @ bench.white_columns[:, first])
            norm = float(np.linalg.norm(course))
            if norm > _LEFT * float(np.linalg.norm(bench.white_columns[:, first])):
                shapes.append((1.0 / norm, first, course / norm, bench.candidates[v]))
        if not shapes:
            continue
        per_d, first, course, candidate = sorted(shapes, key=lambda shape: shape[0])[len(shapes) // 2]
        of_course = replace(
            sums,
            base_target=np.zeros_like(sums.base_target),
            target=np.array([bench.white_columns[rows].T @ course[rows] for rows in bench.blocks]),
        )
        shared = solved(of_course).gain[members[id_]]
        size = per_d * (_weakest(shared, prices[members[id_]], threshold) + float(stats.norm.ppf(_CHANCE)))
        variant = candidate.variant
        coefficients = np.zeros(len(variant.names))
        coefficients[0] = size / bench.scales[first]
        course = variant.columns[bench.fitted, 0] * coefficients[0]
        fitted = Fitted(
            bench.response, unit, variant, coefficients, 0.0 * coefficients, {}, size, float(np.ptp(course))
        )
        parameters = candidate.effect.reading(fitted, comparison).parameters
        told = [(one.meaning, parameters[one.name]) for one in candidate.effect.parameters if one.name in parameters]
        note = "; ".join(f"{meaning}: {amount(value.value, value.unit)}" for meaning, value in told)
        yield Detectable(id_, bench.response, size, unit, _CHANCE, note)


def _weakest(shared: Vector, prices: Vector, threshold: float) -> float:
    """The norm d of a course at which d²·`shared`, as gains of all shapes, makes evidence of the `threshold`."""
    highest = np.sqrt((max(threshold, 0.0) + prices.max() + 2.0 * np.log(len(prices)) + 4.0) / max(shared.max(), 1e-3))

    def missing(d: float) -> float:
        return float(together([evidence_of(d**2 * shared, prices)])) - threshold

    return float(brentq(missing, 0.0, highest, xtol=1e-3)) if missing(0.0) < 0.0 < missing(highest) else float(highest)
