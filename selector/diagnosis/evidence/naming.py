"""How a supported effect is named: course, share, parameters with intervals, confidence; whether it is large enough."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import compress
from operator import attrgetter

import numpy as np

from selector.diagnosis.answer import Evidence, NamedEffect
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.effects.effect import Fitted, Quantity, Variant
from selector.diagnosis.evidence.moments import solved
from selector.diagnosis.evidence.recalibration import Recalibrated
from selector.diagnosis.evidence.response import Bench
from selector.diagnosis.evidence.search import MOST_OF_IT, TENTH, Search, numbers, unseen_rms, without
from selector.diagnosis.finding_table import FINDINGS, SMALL_MISFIT
from selector.diagnosis.matching.runs import pure_error, rms
from selector.diagnosis.shapes.axis import FORCE_ROLES, motion, simulated_forces
from selector.diagnosis.shapes.force_response import PLACE_ROLES, passed
from selector.diagnosis.shapes.heating import sources
from selector.diagnosis.shapes.input_faults import InputFault
from selector.diagnosis.shapes.residual import read_by
from selector.diagnosis.shapes.signals import rise
from selector.diagnosis.wording import is_data
from selector.findings import Finding, Where
from selector.types import Vector

_FALL = 3.84  #: Of the gain, at the ends of a 95 % interval: χ² of one parameter.
_OF_A_STEP = 0.25  #: Of the grid: how far off the top of a parabola through three of its points may be, in logarithms.
_LAG = "tau_s"  #: Ends the names of parameters that stand on a grid of time constants, even in its logarithm.


def shape_intervals(
    bench: Bench, named: Sequence[int], v: int
) -> tuple[Mapping[str, Quantity], dict[str, tuple[float, float]]]:
    """Shape parameters of the named candidate `v`, and the 95 % interval of each where it is known.

    Between grid points of a time constant the gain is a parabola in its logarithm; its top is the value. Where the best
    shape stands at the end of the grid, or has no neighbours to be weighed by, the interval reaches to the next point
    of the grid, and beyond the last one it is open: 0 or infinity.
    """
    others = [other for other in named if other != v]
    gains = solved(bench.moments(bench.base(others))).gain
    own = bench.candidates[v]
    alike = [(k, one.variant) for k, one in enumerate(bench.candidates) if one.effect.id == own.effect.id]
    tried = [variant.shape for _, variant in alike if variant.sources == own.variant.sources]
    key_of = attrgetter("sources", "regime", "run")
    family = [
        (variant.shape, float(gains[k]))
        for k, variant in alike
        if key_of(variant) == key_of(own.variant) and variant.shape.keys() == own.variant.shape.keys()
    ]
    shape, intervals = dict(own.variant.shape), {}
    for key, quantity in own.variant.shape.items():
        near = sorted((one[key].value, gain) for one, gain in family)
        inside = [value for value, gain in near if gain >= gains[v] - _FALL]
        intervals[key] = (min(inside), max(inside))
        if not key.endswith(_LAG) or quantity.value <= 0.0:
            continue
        grid = sorted({one.value for of in tried for name, one in of.items() if name.endswith(_LAG)})
        # the best gain at every value is the last of it
        top = _top(dict(near), quantity.value, grid) if len(own.variant.shape) == 1 else None
        if top is None:
            intervals[key] = (_next(grid, intervals[key][0], -1), _next(grid, intervals[key][1], 1))
            continue
        shape[key] = Quantity(top[0], quantity.unit)
        intervals[key] = (min(intervals[key][0], top[1]), max(intervals[key][1], top[2]))
    return shape, intervals


def _top(gains: Mapping[float, float], value: float, grid: Sequence[float]) -> tuple[float, float, float] | None:
    """Top of the parabola through a value and its neighbours, and where the gain has fallen; None without a top."""
    values = sorted(gains)
    number = values.index(value)
    if not 0 < number < len(values) - 1 or values[number - 1] <= 0.0:
        return None
    three = values[number - 1 : number + 2]
    x, y = np.log(three), np.array([gains[one] for one in three])
    curve, slope, _ = np.polyfit(x - x[1], y - y[1], 2)
    if curve >= 0.0 or y[1] < max(y[0], y[2]):
        return None
    top = float(np.clip(-0.5 * slope / curve, x[0] - x[1], x[2] - x[1]))
    step = 0.5 * float(x[2] - x[0])
    half = float(np.hypot(np.sqrt(_FALL / -curve), _OF_A_STEP * step))
    low, high = (float(value * np.exp(top + side * half)) for side in (-1.0, 1.0))
    low, high = low if low >= grid[0] else 0.0, high if high <= grid[-1] else float("inf")
    return float(f"{value * np.exp(top):.6g}"), low, high


def _next(grid: Sequence[float], value: float, step: int) -> float:
    """The neighbour of a value on the grid; beyond its ends 0 or infinity."""
    number = int(np.argmin(np.abs(np.array(grid) - value))) + step
    if number < 0:
        return 0.0
    return float(grid[number]) if number < len(grid) else float("inf")


_UNCHECKED = 0.9  #: What is left of a confidence that nothing held out could bear out.
#: How sure what is only seen, too, is at most; and, where structure is left, or the name is doubted, one that carries
#: nothing to unseen rows: surer the more it surely carries.
_HALF = 0.5
_GUESS = 0.1  #: Confidence below which a name says next to nothing.
#: Weights, and how often names of such a weight are right: 102 names of real recordings, 203 of development seeds, and
#: 451 of an exam that was over.
_RIGHT = (0.0, 0.5, 0.7, 0.85, 1.0), (0.0, 0.5, 0.75, 0.9, 0.96)
#: How sure what explains little is at most, unless unseen rows bear it out, or it surely closes so much of their gap.
_OFTEN, _SURELY_CLOSED = 0.75, 0.25
_FAR_ABOVE = 4.0
_ONE_SPEED = 0.1  #: Of the usual speed, by which it differs at most.
#: What parameters of a simulation of heat that are a few per cent off look like, and the part of the movement below
#: which it is no surer than they are likely: on 16 machines with values 2 and 5 % off it was 2 to 20 %.
_OF_HEAT = {"thermal.memory", "thermal.convection", "thermal.interaction", "thermal.speed_heating"}
_OF_MOVEMENT, _BEYOND = 0.25, 0.1  #: Its course, and what it does beyond recalibration.
_OF_FORCE = 0.05  #: Of the force that the simulation has of the same kind.
_OF_A_SWITCH = {"thermal.coolant": "thermal.second_source", "thermal.second_source": "thermal.coolant"}
_SHOWN = 9.0  #: Gain from which an effect shows in a response by itself: three standard errors.
_WHOLE = 0.7  #: Confidence of what recalibration shows in one response, and most of its mismatch.
_INPUT_FAULT = 0.9  #: Confidence of a fault that a channel's own course shows and nothing else explains.


def named_effect(comparison: Comparison, found: Search, id_: str, *, is_borne_out: bool = False) -> NamedEffect:
    """The effect as the answer has it; what is little is surer where unseen rows have it as it ought to be there."""
    standing, by_response = found.standing[id_], found.named[id_]
    gains = {name: found.standing[id_].tested[name].gain for name in by_response}
    main = max(gains, key=lambda name: gains[name])
    courses = {name: found.benches[name].course(numbers(found.named, name), v) for name, v in by_response.items()}
    others = without(found.named, id_)
    shares = (found.benches[name].share(numbers(others, name), v) for name, v in by_response.items())
    fitted = _fitted(comparison, found, id_, main, courses[main])
    effect = found.benches[main].candidates[by_response[main]].effect
    reading = effect.reading(fitted, comparison)
    # beyond all that shapes at a wrong time explain is beyond one in so many
    p_value = 1.0 / (1 + len(found.carried[id_][1])) if id_ in found.carried else standing.p_value
    confidence = sum(found.weights[id_].values()) * (1.0 - p_value)
    share = float(np.clip(max(shares), 0.0, 1.0))
    # a frozen reading is proved by its equal readings
    gap = found.closed.get(id_) if id_ != "data.stuck" else None
    if is_structured(found, main):
        carried = 0.0 if gap is None or gap.low is None else float(np.clip(gap.low, 0.0, 1.0))
        confidence = min(confidence, _HALF + _HALF * carried, found.ahead.get(id_, 1.0))
    confidence = float(np.interp(confidence, *_RIGHT))
    if id_ in found.doubted:
        # what surely closes more than half of the gap on unseen rows is right more often than that
        surely = 0.0 if gap is None or gap.low is None else min(gap.low, share)
        confidence = min(confidence, float(np.clip(surely, _HALF, _OFTEN)))
    if gap is not None and gap.high is not None and (share < MOST_OF_IT or id_.startswith("data.")):
        # no surer than the names are shown to carry on unseen rows
        confidence = min(confidence, gap.high)
    is_borne_out |= gap is not None and gap.low is not None and gap.low >= _SURELY_CLOSED
    if share < TENTH and id_ != "data.stuck" and not is_borne_out:
        confidence = min(confidence, _OFTEN)
    # with nothing meant to be kept nothing is lacking
    held = comparison.held_out
    # a fault may be of one run; physics that only one has is borne out by none
    is_of_one_run, is_fault = fitted.variant.run is not None, id_.startswith("data.")
    if is_of_one_run and not is_fault:
        confidence = min(confidence, _HALF)
    is_checked = (is_of_one_run and is_fault) or not held.any()
    is_checked = is_checked or any(np.isfinite(comparison.difference(name)[held]).any() for name in by_response)
    return NamedEffect(
        id=id_,
        channel=main,
        place=fitted.variant.place,
        statement=reading.statement + _or_what_it_reads(comparison, id_, main, fitted.variant.sources),
        parameters=reading.parameters,
        confidence=float(np.clip(confidence, 0.01, 0.99)) * (1.0 if is_checked else _UNCHECKED),
        p_value=float(min(1.0, p_value)),
        share=share,
        cannot_be_told_from=tuple(dict.fromkeys((*found.rivals[id_], *_twins(comparison, found, main, id_, fitted)))),
        experiment=effect.experiment,
        channels=tuple(
            name for name in sorted(gains, key=lambda one: -gains[one]) if name == main or gains[name] > _SHOWN
        ),
        suspected=not is_checked,
        courses=courses,
        acts=_acts(fitted.variant),
        is_fitted=True,
        sources=fitted.variant.sources,
    )


def _twins(comparison: Comparison, found: Search, response: str, id_: str, fitted: Fitted) -> tuple[str, ...]:
    """A line in time for what repeats along the way of an axis at one speed, and back; heat for a switch of coolant.

    The last, and coolant for heat, where nobody says what the switch is of.
    """
    if id_ in _OF_A_SWITCH:
        known = sources(comparison, response)
        is_said = known.is_coolant_said or set(fitted.variant.sources).isdisjoint(known.coolant_switches)
        return () if is_said else (_OF_A_SWITCH[id_],)
    channel = comparison.channel(response)
    along = "drive.pitch_error" if channel.role in PLACE_ROLES else "drive.ripple"
    twin = {"vibration.line": along, along: "vibration.line" if "vibration.line" in found.standing else None}.get(id_)
    moving = motion(comparison, channel.axis) if twin is not None else None
    if twin is None or moving is None:
        return ()
    slow, usual, fast = np.percentile(np.abs(moving.velocity_m_per_s[~comparison.held_out]), (5.0, 50.0, 95.0))
    return () if fast - slow > _ONE_SPEED * usual else (twin,)


def as_carried(effect: NamedEffect, found: Search) -> NamedEffect:
    """The effect no less sure than the part of the gap that it surely closes on unseen rows, up to a half.

    Where more than noise is left, or where the fitted rows are for another one, these rows have chosen it: of laws that
    are all somewhat wrong, that of the largest likelihood in the fitted rows is not the likeliest.
    """
    gap = found.closed.get(effect.id)
    is_chosen = effect.id in found.ahead or effect.confidence < _GUESS
    if not is_chosen or gap is None or gap.low is None:
        return effect
    least = min(_HALF, gap.low) * (_HALF if effect.suspected else 1.0)
    return replace(effect, confidence=max(effect.confidence, least))


def is_like_parameters(comparison: Comparison, found: Search, effect: NamedEffect) -> bool:
    """Whether wrong parameters of the simulation do the same as an effect, or as what it cannot be told from."""
    # no parameter is wrong in one run alone
    rivals = effect.cannot_be_told_from if effect.acts is None else ()
    if _OF_HEAT.isdisjoint((effect.id, *rivals)):
        return _is_little_force(comparison, found, effect)
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


def _is_little_force(comparison: Comparison, found: Search, effect: NamedEffect) -> bool:
    """Whether an inertia or a friction is little beside that of the simulation, in a force that is compared."""
    for name, v in found.named.get(effect.id, {}).items():
        channel = comparison.channel(name)
        if found.benches[name].candidates[v].variant.regime is not None:
            # no parameter is right in some runs
            return False
        own = simulated_forces(comparison, channel.axis).get(effect.id) if channel.role in FORCE_ROLES else None
        if own is not None:
            fitted = found.benches[name].fitted
            given = passed(comparison, name, own)[0]
            return rms(effect.courses[name][fitted]) < _OF_FORCE * rms(given[fitted])
    return False


def is_structured(found: Search, response: str) -> bool:
    """Whether more is left of a response than noise."""
    return found.misfit.get(response, 1.0) > 1.0 or is_far_above_noise(found, response)


def is_far_above_noise(found: Search, response: str) -> bool:
    """Whether what is left is many times its changes from sample to sample: noise that wanders, or nobody's misfit."""
    bench = found.benches[response]
    left = bench.residual(numbers(found.named, response))
    return rms(left[bench.fitted]) > _FAR_ABOVE * bench.quick(left)


def _or_what_it_reads(comparison: Comparison, id_: str, response: str, sources: Sequence[str]) -> str:
    """A fault in a reading that drives the simulation looks like one of the response."""
    if not id_.startswith("data.") or any(name != response for name in sources):
        return ""
    names = ", ".join(read_by(comparison, response))
    text = f" The simulation of {response} follows {names}: the fault may be in one of these readings instead."
    return text if names else ""


def _acts(variant: Variant) -> tuple[str, float | None, float | None] | None:
    if variant.run is None:
        return None
    first, last = variant.shape.get("from_s"), variant.shape.get("to_s")
    return variant.run, None if first is None else first.value, None if last is None else last.value


def _fitted(comparison: Comparison, found: Search, id_: str, response: str, course: Vector) -> Fitted:
    bench, v = found.benches[response], found.named[id_][response]
    named = numbers(found.named, response)
    beta, covariance = bench.coefficients(named)
    here = bench.place(named, v)
    candidate = bench.candidates[v]
    scale = bench.scales[candidate.columns]
    shape, intervals = shape_intervals(bench, named, v)
    risen = rise(comparison, course, over_samples=1)[bench.fitted]
    return Fitted(
        response=response,
        unit=comparison.channel(response).unit,
        variant=replace(candidate.variant, shape=shape),
        coefficients=beta[here] / scale,
        standard_errors=np.sqrt(np.diag(covariance)[here]) / scale,
        shape_intervals=intervals,
        rms=float(np.sqrt(np.mean(course[bench.fitted] ** 2))),
        largest=float(np.abs(course[bench.fitted] - np.median(course[bench.fitted])).max()),
        extremes=(float(risen.min()), float(risen.max())),
    )


def whole_record_effect(
    comparison: Comparison,
    benches: Mapping[str, Bench],
    again: Mapping[str, Recalibrated],
    id_: str,
    shown: Mapping[str, str],
) -> NamedEffect:
    """An effect that recalibration shows, the same in all runs; `shown` is response → offset, gain or delay."""
    effect = effect_of(id_)
    main = max(shown, key=lambda name: again[name].gain)
    word = shown[main]
    value, unit = again[main].quantities[word], comparison.channel(main).unit
    courses = {}
    for name in shown:
        bench = benches[name]
        column = bench.nuisance_names.index(shown[name])
        courses[name] = bench.nuisance[:, column] * bench.coefficients([])[0][column]
    interval = value.words()
    force = f"force_{unit.lower()}"
    off = f"{main} is recorded {interval} times too large"
    if value.value < 1.0 and value.low and value.high:
        small = Quantity(1.0 / value.value, "1", 1.0 / value.high, 1.0 / value.low)
        off = f"{main} is recorded {small.words()} times too small"
    statement, key = {
        "data.gain": (f"{off} in all runs, or simulated so, and no other response is.", "gain"),
        "data.zero": (
            f"{main} reads {interval} more than simulated, in all runs and whatever the machine does.",
            "zero",
        ),
        "data.clock": (f"{main} is recorded {interval} late, in all runs, and no other response is.", "shift_s"),
        "drive.offset_force": (f"A constant of {interval} acts in {main} whatever the motion, at rest too.", force),
    }[id_]
    return NamedEffect(
        id=id_,
        channel=main,
        place=comparison.channel(main).place,
        statement=statement,
        parameters={key: value},
        confidence=_WHOLE if again[main].share >= MOST_OF_IT else _HALF,
        p_value=again[main].p_value,
        share=float(np.clip(again[main].share, 0.0, 1.0)),
        cannot_be_told_from=("data.zero",) if id_ == "drive.offset_force" else (),
        experiment=effect.experiment,
        channels=tuple(sorted(shown, key=lambda name: -again[name].gain)),
        courses=courses,
        is_fitted=True,
    )


def input_fault_effect(comparison: Comparison, fault: InputFault) -> NamedEffect:
    """A fault of a recorded channel that is no response, told by its own course and its siblings."""
    channel = fault.channel or comparison.responses[0]
    return NamedEffect(
        id=fault.id,
        channel=channel,
        place=comparison.channel(channel).place,
        statement=fault.statement,
        parameters={"from_s": Quantity(fault.from_s, "s"), "to_s": Quantity(fault.to_s, "s")},
        confidence=_INPUT_FAULT,
        p_value=1.0 - _INPUT_FAULT,
        share=0.0,
        cannot_be_told_from=(),
        experiment=effect_of(fault.id).experiment,
        channels=(channel,),
        courses={channel: fault.course},
        acts=(fault.run, fault.from_s, fault.to_s),
    )


_MOST = 0.4
_LITTLE = 0.015  #: Of the movement of what is recorded: a mismatch that is practically none, however significant it is.
_NOTHING = 0.001  #: The same where what is left is noise, for all that is seen.
#: Of the movement: structure, and all that recalibration leaves, that are little beside what it puts right; what that
#: leaves of the error.
_LITTLE_BESIDE, _ALL_LEFT, _MUCH_SMALLER = 0.04, 0.1, 0.8
_LISTED = 0.01
#: Times the pure error of repeats: what two recordings of the machine itself differ by.
_AS_REPEATED = float(np.sqrt(2.0))


def of_practical_size(comparison: Comparison, found: Search) -> tuple[Search, tuple[NamedEffect, ...]]:
    """The search with names that matter alone, and those that are only seen, too.

    Where what is left is not noise alone, everything is significant. If all names together explain less than two fifths
    of what is above the noise, less than three quarters of what is little in one run, or a mismatch that does not
    matter, the mismatch is something else. A frozen reading is proved by its equal readings. What explains less than a
    hundredth is not told of.
    """
    doubted = {
        id_
        for id_, of in found.named.items()
        if id_ != "data.stuck"
        and (
            all(_is_trifle(comparison, found, name, is_noise=found.misfit[name] == 1.0) for name in of)
            or (all(found.misfit[name] > 1.0 for name in of) and max(_explained(comparison, found)) < _MOST)
            or all(_is_part_of_little(comparison, found, name) for name in of)
        )
    }
    also = {id_: of for id_, of in {**found.named, **found.small}.items() if id_ in doubted or id_ not in found.named}
    rest = replace(found, named={id_: of for id_, of in found.named.items() if id_ not in doubted})
    return rest, seen_only(_beside(comparison, found, id_, of) for id_, of in also.items())


def _is_part_of_little(comparison: Comparison, found: Search, response: str) -> bool:
    """Whether names explain less than three quarters of a mismatch that is no noise, and little in one run."""
    bench = found.benches[response]
    left = bench.mean_square(numbers(found.named, response)) / bench.mean_square([])
    is_part = found.misfit[response] > 1.0 and left > 1.0 - MOST_OF_IT
    return is_part and is_little_in_one_run(comparison, found, response)


def seen_only(effects: Iterable[NamedEffect]) -> tuple[NamedEffect, ...]:
    """Effects that are seen, too, without being called missing; without those that are too little to be told of."""
    return tuple(
        replace(effect, suspected=True, confidence=min(_HALF, effect.confidence), is_fitted=False)
        for effect in effects
        if effect.share >= _LISTED
    )


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

    That is what repeats of a programme differ by as well, or a step of the reading, unseen rows too; a trifle of what
    was recorded; and little of it, where recalibration has made the error much smaller, in unseen rows as well: that is
    what is to be done first.
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
    """How far a response moves, or a position is off its command.

    That is 0, and not known, where the only commands are of another unit, or of another axis: such a position is
    further off them than it moves.
    """
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


def noise_floor(comparison: Comparison, bench: Bench, named: Sequence[int], *, is_noise: bool) -> float:
    """Standard deviation of the noise of a response [unit]: from repeats, else from what is left.

    What is left counts as noise only where it `is_noise`; otherwise its third differences from sample to sample do,
    which slow structure hardly has. It is never above what is left, and never below the rounding.
    """
    left = bench.residual(named)
    n, p = int(np.sum(bench.fitted)), bench.raw_base(named).shape[1]
    floor = rms(left[bench.fitted]) * float(np.sqrt(n / max(n - p, 1)))
    repeated = pure_error(comparison, bench.response)
    if repeated is not None:
        floor = min(floor, repeated)
    elif not is_noise:
        floor = float(np.nanmin([floor, bench.quick(left)]))
    return max(floor, bench.rounding)


def evidence_rows(found: Search, untested: Mapping[str, Mapping[str, str]]) -> tuple[Evidence, ...]:
    """How every effect stands, the clearest first, and those that could not be tested; `untested` is response → why."""
    rows = []
    for id_, one in sorted(found.standing.items(), key=lambda item: -item[1].score):
        note = "" if one.is_the_same_in_all_runs else "differs from run to run"
        note = "borne out by unseen rows" if id_ in found.carried else note
        rows.append(Evidence(id_, one.responses[0], one.score, one.p_value, id_ in found.named, note))
    for response, reasons in untested.items():
        rows += [
            Evidence(id_, response, 0.0, 1.0, False, f"not testable here: {why}")
            for id_, why in reasons.items()
            if id_ not in found.standing
        ]
    return tuple(rows)


def part_of(found: Search, effect: NamedEffect) -> float:
    """Mean square of an effect's course in parts of that of the mismatch beside recalibration, fitted rows."""
    parts = []
    for name, course in effect.courses.items():
        bench = found.benches[name]
        alone = bench.mean_square([])
        parts.append(float(np.var(course[bench.fitted])) / alone if alone > 0.0 else 0.0)
    return max(parts)
